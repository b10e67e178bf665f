"""Faults of the interpreter that threads of a computation would meet, and what a program that imports us keeps."""

import ast
import gc
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

from warpimpact.solver.device import building


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


def test_garbage_in_a_parse_ends_no_other_parse_during_a_build() -> None:
    interval, thresholds = sys.getswitchinterval(), gc.get_threshold()
    try:
        sys.setswitchinterval(1e-6)
        gc.set_threshold(20)
        with building(), ThreadPoolExecutor(4) as pool:
            list(pool.map(parse_often, range(8)))
    finally:
        sys.setswitchinterval(interval)
        gc.set_threshold(*thresholds)


def test_an_import_and_a_build_leave_the_functions_of_the_host_process() -> None:
    program = """
import ast, os
parse, error = ast.parse, os.fstat(2)
import warpimpact.api
from warpimpact.kernels import free_flight
from warpimpact.kernels.variant import Variant
from warpimpact.solver import device, memory
assert ast.parse is parse
device.find_device("cpu")
memory.built(free_flight, Variant())
assert ast.parse is parse and os.path.samestat(os.fstat(2), error)
"""
    subprocess.run([sys.executable, "-c", program], check=True)
