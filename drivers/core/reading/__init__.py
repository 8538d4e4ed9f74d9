"""Text from elsewhere, read with bounds."""
