"""ATI electronics as their clients meet them."""
