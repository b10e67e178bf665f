"""Faults of the interpreter that threads of a computation would meet."""

import ast
import gc
import sys
from concurrent.futures import ThreadPoolExecutor

import warpimpact.solver.device  # noqa: F401  whose import is what is tested


class Garbage:
    """That only a collection finds, which then runs Python code."""

    def __init__(self) -> None:
        self.me = self

    def __del__(self) -> None:
        sum(range(50))


def parse_often(_: int) -> None:
    for _ in range(500):
        Garbage()
        ast.parse("f(g(h(1, 2, (3, 4, [5, 6]))))")


def test_garbage_in_a_parse_ends_no_other_parse() -> None:
    interval, thresholds = sys.getswitchinterval(), gc.get_threshold()
    try:
        sys.setswitchinterval(1e-6)
        gc.set_threshold(20)
        with ThreadPoolExecutor(4) as pool:
            list(pool.map(parse_often, range(8)))
    finally:
        sys.setswitchinterval(interval)
        gc.set_threshold(*thresholds)
