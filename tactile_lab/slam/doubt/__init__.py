"""What an estimate does not know about itself: its status, its doubts, its rivals, and the part that was touched."""
