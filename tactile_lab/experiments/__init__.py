"""Experiments on simulated contacts: the figures of the thesis, and the methods compared over many seeds."""
