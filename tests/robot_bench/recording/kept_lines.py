"""What the tests of the bench compare whole."""

from tests.tools.suite.golden import kept_in

is_as_kept = kept_in("bench")
