"""CasADi functions as generated C where that can be had, else in CasADi's virtual machine.

Both forms come from the same expressions. Generated C is compiled by a process beside this one, so that what is built
together takes no longer than the longest of it. It is used only after it has agreed with the virtual machine on random
problems; where it cannot be built or does not agree, the virtual machine serves, several times slower, and `note` says
why.
"""

from collections.abc import Callable, Generator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import casadi as ca

from ik_service.compiler import CompileError, build

AGREEMENT_PROBLEMS = 16
"""Random problems on which generated C and virtual machine must agree."""

AGREEMENT = 1e-6
"""Largest difference of two answers that agree, in radians and radians a second, and of what is said of them; rounding
leaves about 1e-9."""


@dataclass(frozen=True)
class Form:
    """Functions ready to be called.

    Attributes:
        functions: In the order in which they were given.
        kind: "c" for generated C, "vm" for the virtual machine.
        note: One line on why they are not what was asked for, or why the cache was not used; else empty.
    """

    functions: tuple[ca.Function, ...]
    kind: Literal["c", "vm"]
    note: str = ""


@contextmanager
def building(
    name: str,
    machine: Sequence[ca.Function],
    agrees: Callable[[tuple[ca.Function, ...]], bool],
    compiled: bool = True,
    folder: Path | None = None,
) -> Generator[Callable[[], Form]]:
    """Begin to build functions.

    Args:
        name: What they are, in a word or two.
        machine: They, in the virtual machine.
        agrees: Whether generated ones compute the same as these.
        compiled: Whether to use generated C where possible.
        folder: Cache folder of compiled kernels; None for the per-user one.

    Yields:
        What waits for the functions and returns them; it never fails for want of a compiler. What is not waited for
        is given up.
    """
    with ExitStack() as stack:
        fault = ""
        if compiled:
            try:
                wait = stack.enter_context(build(source(name, machine), folder))
            except CompileError as error:
                fault = str(error)

        def finish() -> Form:
            if fault or not compiled:
                return Form(tuple(machine), "vm", fault)
            try:
                library = wait()
                generated = tuple(ca.external(function.name(), str(library.path)) for function in machine)
            except CompileError as error:
                return Form(tuple(machine), "vm", str(error))
            except RuntimeError:  # CasADi, for a library that the dynamic loader refuses
                return Form(tuple(machine), "vm", f"the compiled {name} cannot be loaded")
            if not agrees(generated):
                note = f"the compiled {name} computes something else than the virtual machine"
                return Form(tuple(machine), "vm", note)
            return Form(generated, "c", library.note)

        yield finish


def source(name: str, machine: Sequence[ca.Function]) -> str:
    """The functions in C."""
    generator = ca.CodeGenerator(name.replace(" ", "_"))
    for function in machine:
        generator.add(function)
    return generator.dump()
