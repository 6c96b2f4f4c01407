/* The adapter core behind a plain C interface, which robot_bench loads as a
 * shared library in the place of the model.
 *
 * Times are nanoseconds. Nothing here blocks, allocates after adapter_new, or reads
 * a clock. An adapter must be used from one thread. */
#ifndef ADAPTER_CAPI_H
#define ADAPTER_CAPI_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Raised when the meaning or the order of anything below changes. */
#define ADAPTER_CAPI_VERSION 4

typedef struct adapter_handle adapter_handle;

/* What the far side does. `user` comes back in each call. */
typedef struct {
  void* user;
  /* Word of the input wires at an instant: motor1, motor2, p2dx_con, rst. */
  uint32_t (*read)(void* user, int64_t at);
  /* Share of a period at which the wire of a bit of that word is high, 0 to 1000; only called where motor_command
   * is 1. */
  int32_t (*duty)(void* user, int32_t bit, int64_t at);
  /* Drives the wires of mask; a mask of 0 releases all. */
  void (*drive)(void* user, uint32_t mask, uint32_t levels, int64_t now);
  /* An event; what and detail are static texts. */
  void (*happened)(void* user, int64_t now, const char* what, const char* detail, int32_t first, int32_t second);
} adapter_callbacks;

int32_t adapter_version(void);

/* Returns NULL and sets *fault where the numbers are refused. The arrays hold what
 * adapter_setting_name, adapter_robot_name and adapter_wire_name list, in that order. */
adapter_handle* adapter_new(const int64_t* settings, const int64_t* robot, const int64_t* wires,
                            const adapter_callbacks* callbacks, int64_t now, const char** fault);
void adapter_free(adapter_handle* handle);

/* Names of the numbers by their place; NULL after the last. */
const char* adapter_setting_name(int32_t place);
const char* adapter_robot_name(int32_t place);
const char* adapter_wire_name(int32_t place);

void adapter_receive(adapter_handle* handle, const uint8_t* data, size_t size, int64_t now);
/* Buttons: bit 0 is Up, bit 1 is Down. */
void adapter_receive_pad(adapter_handle* handle, int32_t buttons, int32_t forward, int32_t backward, int32_t turn,
                         int64_t now);
/* 0 is the BluePill, 1 the pad. */
void adapter_set_master(adapter_handle* handle, int32_t master, int64_t now);
void adapter_shutdown(adapter_handle* handle, const char* reason, int64_t now);
void adapter_advance_to(adapter_handle* handle, int64_t limit);
/* Where nothing changes at the samples to come as long as no input wire does, that is the next deadline which is no
 * sample, if adapter_wait_for_edges was called. */
int64_t adapter_next_deadline(const adapter_handle* handle);
/* From now on adapter_advance_to is called at each edge of the input wires while adapter_is_suspended. The samples that
 * were left out are taken then, all of them with the word that was read last. */
void adapter_wait_for_edges(adapter_handle* handle);
int32_t adapter_is_suspended(const adapter_handle* handle);
/* Copies the oldest frame that has to go out, at most 9 bytes; returns its size, 0 for none. */
size_t adapter_take_output(adapter_handle* handle, uint8_t* frame);

/* What it knows; the places are those of adapter_status_name. */
const char* adapter_status_name(int32_t place);
void adapter_status(const adapter_handle* handle, int64_t* values);
const char* adapter_state(const adapter_handle* handle);
const char* adapter_reason(const adapter_handle* handle);
/* How the robot identified itself: 0 name, 1 class, 2 subclass. */
const char* adapter_robot_text(const adapter_handle* handle, int32_t place);

/* Saving: a state fits adapter_state_size() bytes, and only this build and process can read it back. */
size_t adapter_state_size(void);
void adapter_save(const adapter_handle* handle, void* state);
void adapter_restore(adapter_handle* handle, const void* state);

#ifdef __cplusplus
}
#endif

#endif
