"""ADC and DMA, driven at random from reset, against traces that were approved."""

from tests.bluepill_sim.peripherals.walks.traces import traces_of
from tests.tools.suite.approved import judge_of

TRACES = traces_of("ADC", "DMA1")
test_a_walk_shows_what_was_approved = judge_of(__file__, TRACES)
