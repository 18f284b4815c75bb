#ifndef SHAPEGCODE_HAL_H
#define SHAPEGCODE_HAL_H

/* What the component shapegcode_shaper.comp calls: a filter for the joints of one instance, and a thread of its own,
 * not real-time, that designs shapers when the settings change. */

#ifdef __cplusplus
extern "C" {
#endif

enum { SHAPEGCODE_HAL_MODES = 3 };

/* The pins that are read. */
struct shapegcode_hal_settings {
  int enabled;
  int family_number;
  double frequency_hz[SHAPEGCODE_HAL_MODES];
  double damping_ratio[SHAPEGCODE_HAL_MODES];
  double fade_s;   /* over how long a new shaper comes in; 0: not before the joints rest */
  double period_s; /* of the thread */
};

/* The pins that are written. */
struct shapegcode_hal_status {
  int possible;      /* 0: these settings are impossible, the shaper before them goes on */
  int waiting;       /* 1: another shaper than the one asked for is at work still */
  double delay_s;    /* mean delay of the shaper at work */
  double duration_s; /* how much longer it moves than its input */
};

struct shapegcode_hal;

/* Where a function of the real-time thread finds its filter. It outlives filter and thread; all zero at first. What is
 * in it belongs to the functions below. */
struct shapegcode_hal_slot {
  struct shapegcode_hal* hal;     /* NULL: commands are passed on */
  struct shapegcode_hal* leaving; /* taken out, may be in use still */
  unsigned long long begun;       /* runs of the real-time thread */
  unsigned long long ended;
  double period_s; /* of its last run */
};

/* A filter for that many joints that passes its input on, into an empty slot: 0, or -1 where that cannot be. `report`
 * gets a line that says why settings are impossible, from the other thread. Not real-time. */
int shapegcode_hal_open(struct shapegcode_hal_slot* slot, int joints, void (*report)(const char* line));

/* One sample of every joint: through the filter, or passed on where there is none. Real-time, one thread for each slot:
 * no allocation, no lock, no system call, bounded work. `in` and `out` may be the same memory. */
void shapegcode_hal_run(struct shapegcode_hal_slot* slot, int joints, const struct shapegcode_hal_settings* settings,
                        const double* in, double* out, struct shapegcode_hal_status* status);

enum shapegcode_hal_closed {
  SHAPEGCODE_HAL_ACKNOWLEDGED, /* a run that began without the filter has ended since */
  SHAPEGCODE_HAL_NOT_RUNNING,  /* there is none, and no run came for 20 periods (10 ms at least, 1 s at most) */
  SHAPEGCODE_HAL_IN_USE        /* a run that began with the filter does not end (1 s): it is not freed, close again */
};

/* Takes the filter out, waits until no run has it, ends its thread and frees it. The real-time thread may run on
 * meanwhile and afterwards. Not real-time. */
enum shapegcode_hal_closed shapegcode_hal_close(struct shapegcode_hal_slot* slot);

#ifdef __cplusplus
}
#endif

#endif
