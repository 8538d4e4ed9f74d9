"""One HTML file that shows a session: opens from disk, fetches nothing, prints."""
