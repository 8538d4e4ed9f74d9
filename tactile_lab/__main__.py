"""``python -m tactile_lab``: the same as ``tactile-lab``."""

from __future__ import annotations

from tactile_lab.cli.main import main

if __name__ == "__main__":
    main()
