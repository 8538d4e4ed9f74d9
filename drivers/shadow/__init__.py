"""The Shadow Dexterous Hand."""
