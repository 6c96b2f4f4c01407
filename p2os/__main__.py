"""`python -m p2os`: the command line, for a Python whose scripts are not on the path."""

from p2os.cli.main import main

if __name__ == "__main__":
    main()
