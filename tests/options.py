"""Options of computations in tests."""

from warpimpact import RunOptions

CPU = RunOptions("cpu")
