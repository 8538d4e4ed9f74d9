"""Simulated contacts and hands."""
