"""What distinguishes one build of the kernels from another."""

import os
from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import cached_property
from types import ModuleType, SimpleNamespace
from typing import Any

import warp as wp

CPU_FLAGS = os.environ.get(
    "WARPIMPACT_CPU_FLAGS",
    "-march=native -mprefer-vector-width=512 -mllvm=-inline-threshold=9000 -mstackrealign -fno-slp-vectorize "
    "-mreassociate -fno-signed-zeros -freciprocal-math -ffp-contract=fast",
)
"""Flags that let the compiler vectorise sums and divisions as wide as the processor can; for Intel its default is half
of that. NaN and infinity keep their meaning. Straight-line code stays scalar, because on some processors the compiler
breaks a large kernel there (LLVM: "Instruction does not dominate all uses"), and loops take most of the time. Tests
set others by the environment variable, which the processes that they start inherit."""


@dataclass(frozen=True)
class Variant:
    """One specialisation of the device code; physics that a scene does not use is not compiled.

    Attributes:
        double: float64 instead of float32.
        nodal: the paper's literal scheme instead of the consistent law.
        degrades: the plate weakens (β < 1).
        rubs: there is friction (η > 0).
        rate_dependent: the normal stress depends on the normal velocity (a1 or a2 > 0).
        free_surface: a surface element resists less near a face or an edge.
        rimmed: the plate is finite.
        bends: the core's largest bending moment is recorded.
        layered: the target has several layers.
        window: largest number of nodes of a shot's window in shared memory, in the block layout: one block of CUDA
            threads per shot (kernels/block.py). 0 is the simple layout: one thread per shot, windows in global memory.
    """

    double: bool = False
    nodal: bool = False
    degrades: bool = True
    rubs: bool = True
    rate_dependent: bool = False
    free_surface: bool = False
    rimmed: bool = False
    bends: bool = False
    layered: bool = False
    window: int = 0

    @property
    def real(self) -> Any:
        """The floating-point type of positions, velocities and fields."""
        return wp.float64 if self.double else wp.float32

    @property
    def reals(self) -> Any:
        """An array of these."""
        return wp.array(dtype=self.real)

    @cached_property
    def vec2(self) -> Any:
        return wp.types.vector(2, self.real)

    @cached_property
    def vec3(self) -> Any:
        return wp.types.vector(3, self.real)

    @cached_property
    def mat33(self) -> Any:
        return wp.types.matrix((3, 3), self.real)

    @cached_property
    def quat(self) -> Any:
        return wp.types.quaternion(self.real)

    @property
    def name(self) -> str:
        """A legal identifier, unique to the variant."""
        given = {field.name: getattr(self, field.name) for field in fields(self)}
        parts = [name if value is True else f"{name}{value}" for name, value in given.items() if value]
        return "_".join(["variant", *parts])

    def use(self, *modules: ModuleType) -> SimpleNamespace:
        """The builds of some modules for this variant, each under the module's name."""
        return SimpleNamespace(**{module.__name__.rpartition(".")[2]: module.build(self) for module in modules})

    def kernel(
        self, function: Callable[..., None], launch_bounds: tuple[int, ...] | None = None, **types: Any
    ) -> wp.Kernel:
        """The launchable kernel of a device function. It has its own module, so that only launched kernels are
        compiled.

        Args:
            launch_bounds: threads of a block on CUDA, and the least number of blocks on a multiprocessor.
            **types: of the arguments that the function leaves open (`Any`), by name; others are passed over.
        """
        module = wp.get_module(f"{function.__module__}.{self.name}")
        module.options["enable_backward"] = False
        module.options["cpu_compiler_flags"] = CPU_FLAGS
        if launch_bounds is None:
            kernel = wp.Kernel(function, key=function.__name__, module=module)
            open_types = {name: types[name] for name in types.keys() & kernel.adj.arg_types.keys()}
            return wp.overload(kernel, open_types) if open_types else kernel
        module.options["block_dim"] = launch_bounds[0]
        return wp.Kernel(function, key=function.__name__, module=module, options={"launch_bounds": launch_bounds})
