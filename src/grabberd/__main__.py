"""Entry point of `python -m grabberd`, which is the command `grabberd` where that is on no path."""

from grabberd.cli import main

if __name__ == "__main__":
    main()
