"""Goals of a scenario: what a run must show, judged while it runs.

`kinds` is the table of all kinds, and `watch` what each is made of; `judging` feeds them. A kind of a
user's own is a `GoalKind` under the entry point `robot_bench.goals`.
"""
