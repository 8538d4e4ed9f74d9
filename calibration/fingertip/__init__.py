"""What fingertips are like: mounting, weight and shape of force sensors, electrodes and normals of BioTacs."""
