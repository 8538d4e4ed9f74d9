"""Sessions as datasets for robot learning, in the form of the package ``lerobot``."""
