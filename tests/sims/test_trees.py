"""Trees of random parents: who hangs from a node is who comes by it on the way down."""

from hypothesis import given, settings
from hypothesis import strategies as st

from warpdribble.sims.trees import below

parents = st.integers(0, 12).flatmap(lambda n: st.tuples(*[st.integers(-1, i - 1) for i in range(n)]))


@settings(max_examples=200, deadline=None, derandomize=True)
@given(parents)
def test_below(parents):
    for node in range(len(parents)):
        expected = []
        for other in range(len(parents)):
            way = other
            while way > node:
                way = parents[way]
            expected += [other] if way == node else []
        assert below(parents, node) == expected
