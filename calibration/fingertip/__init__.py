"""Calibration of fingertips: mounting, weight and shape of force sensors, electrodes and normals of BioTacs."""
