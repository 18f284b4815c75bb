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

/* A filter for that many joints that passes its input on, or NULL. `report` gets a line that says why settings are
 * impossible, from the other thread. Not real-time. */
struct shapegcode_hal* shapegcode_hal_create(int joints, void (*report)(const char* line));

/* Ends the thread and frees everything. A shapegcode_hal_step that is running may end first, none may begin. Not
 * real-time. */
void shapegcode_hal_destroy(struct shapegcode_hal* hal);

/* One sample of every joint. Real-time: no allocation, no lock, no system call, bounded work. `in` and `out` may be the
 * same memory. */
void shapegcode_hal_step(struct shapegcode_hal* hal, const struct shapegcode_hal_settings* settings, const double* in,
                         double* out, struct shapegcode_hal_status* status);

#ifdef __cplusplus
}
#endif

#endif
