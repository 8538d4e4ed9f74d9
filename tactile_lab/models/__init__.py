"""The estimated shape as a model for simulators and CAD programs."""
