"""`python -m socialnav_mj` is the command `socialnav-mj`."""

from socialnav_mj.cli import main

if __name__ == "__main__":
    main()
