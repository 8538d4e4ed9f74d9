"""Devices of the laboratory: links move bytes, codecs turn them into samples, devices own the lifecycle.

``(protocols: Net F/T)`` in a docstring names a section of ``docs/protocols.md``, where the bytes of every device and
how far each fact can be trusted are written down.
"""
