"""`python -m shipland`."""

from shipland.cli import main

if __name__ == "__main__":
    main()
