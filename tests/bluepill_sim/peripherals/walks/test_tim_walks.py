"""TIM, driven at random from reset, against traces that were approved."""

from tests.bluepill_sim.peripherals.walks.approved import judge_of

test_a_walk_shows_what_was_approved = judge_of("TIM1", "TIM2", "TIM3", "TIM4")
