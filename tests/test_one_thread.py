"""The library computes with one thread of BLAS, and leaves the program's own number as it was."""

import numpy as np
from threadpoolctl import threadpool_info, threadpool_limits

from grabberd.memory import one_thread


def threads() -> set[int]:
    np.linalg.inv(np.eye(3))
    return {one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"}


def test_it_computes_with_one() -> None:
    with threadpool_limits(2, user_api="blas"):
        before = threads()
        assert one_thread(threads)() == {1}
        assert threads() == before
