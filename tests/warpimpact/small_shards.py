"""Importing this module makes shards small, so that a short run has many; processes of tests import it, too."""

from warpimpact.runs import shards

SIZE = 256
shards.FEWEST = SIZE
shards.HELD = 0.0  # a test follows the shards on the disk
shards.SHARDS = 2**12  # so that those of a very long run are small, too
