"""Importing this module makes chunks small, so that a short run has many; processes of tests import it, too."""

from warpimpact.measures import draws
from warpimpact.runs import compute, store

draws.COUNT = 16  # as few as few_draws has
compute.FEWEST = 256
compute.CHUNKS = compute.LOOKS = 2**12  # so that those of a very long run are small, too
store.HELD_SECONDS = 0.0  # a test follows the chunks on the disk
