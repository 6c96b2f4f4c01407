#pragma once
extern "C" unsigned char btstack_init(void);
