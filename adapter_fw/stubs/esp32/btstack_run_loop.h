#pragma once
extern "C" void btstack_run_loop_execute(void);
