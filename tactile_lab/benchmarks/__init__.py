"""Speed and memory, beside the obvious alternative."""
