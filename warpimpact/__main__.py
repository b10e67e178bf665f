"""Runs the command as `python -m warpimpact`."""

from warpimpact.cli import command

if __name__ == "__main__":
    command()
