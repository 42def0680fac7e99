"""Where the benchmarks' tests find the compiled kernel."""

from collections.abc import Iterator
from pathlib import Path

import pytest


@pytest.fixture(scope="module", autouse=True)
def _kernel_of_this_run(kernel_cache: Path) -> Iterator[None]:
    """Benchmarks, and the services they start, use the kernel that was compiled for this run of the suite."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("IK_CACHE_DIR", str(kernel_cache))
        yield
