"""Importing this module makes shards small, so that a short run has many; processes of tests import it, too."""

from warpimpact.campaign import parts

SIZE = 256
parts.FEWEST = SIZE
parts.HELD = 0.0  # a test follows the shards on the disk
