component shapegcode_shaper "Input shaping of joint commands: leaves a machine's modes without excitation";

description """
Stands between \\fBjoint.N.motor-pos-cmd\\fR and the drives. All joints of an instance go through one shaper, so that a
straight line stays straight; \\fBpersonality\\fR says how many joints there are (1 to 9), for example
\\fBloadrt shapegcode_shaper personality=3\\fR.

A shaper is designed outside of the real-time thread, some 20 ms after a pin has changed, and comes in without a step in
position: with \\fBfade\\fR 0 not before the joints have rested for as long as the shaper lasts, else over \\fBfade\\fR
seconds while they move.""";

pin in float in-#[9 : personality ? personality : 1] "Command, of \\fBmotor-pos-cmd\\fR";
pin out float out-#[9 : personality ? personality : 1] "Shaped command, for the drive";
pin out float lag-#[9 : personality ? personality : 1]
"\\fBin\\fR - \\fBout\\fR: added to the drive's feedback it takes the shaper's delay out of the following error";
pin in bit enable = false "Shape; off: the command passes through as it is";
pin in s32 family = 0
"0 ZV, 1 ZVD, 2 ZVDD, 3 MZV, 4 EI, 5 and 6 EI with two and three humps (5 % left at most)";
pin in float frequency-#[3] "Natural frequency of a mode in Hz; 0: no mode";
pin in float damping-#[3] "Damping ratio of that mode, 0 to below 1";
pin in float fade = 0.0 "Seconds over which another shaper comes in while joints move; 0: wait until they rest";
pin out bit ok = true "Off: these settings are impossible (the reason is printed); the shaper before them goes on";
pin out bit pending "Another shaper than the one asked for is still at work";
pin out float delay "Mean delay of the shaper at work in s: following error over speed";
pin out float duration "How much longer it moves than its input, in s";

function _;

option extra_setup;
option extra_cleanup;
variable void *shaper;

author "shapegcode developers";
license "MIT";
include "shapegcode_hal.h";
;;

static struct shapegcode_hal_slot slots[64];
static int slot_count;

static void report(const char *line) { rtapi_print_msg(RTAPI_MSG_ERR, "shapegcode_shaper: %s\n", line); }

EXTRA_SETUP() {
  int joints = personality ? personality : 1;
  (void)prefix;
  (void)extra_arg;
  if (joints < 1 || joints > 9 || slot_count == 64) {
    rtapi_print_msg(RTAPI_MSG_ERR, "shapegcode_shaper: personality %d, 1 to 9 joints needed\n", joints);
    return -EINVAL;
  }
  if (shapegcode_hal_open(&slots[slot_count], joints, report)) return -ENOMEM;
  shaper = &slots[slot_count++];
  return 0;
}

EXTRA_CLEANUP() {
  /* The servo thread may run still: from here on it passes commands on, and has just said so when LinuxCNC takes the
   * functions out of the thread, which nothing guards: a whole period before it comes again. */
  while (slot_count > 0) {
    if (shapegcode_hal_close(&slots[--slot_count]) == SHAPEGCODE_HAL_IN_USE)
      rtapi_print_msg(RTAPI_MSG_ERR, "shapegcode_shaper: a run of its function does not end, memory is not freed\n");
  }
}

FUNCTION(_) {
  double command[9], shaped[9];
  struct shapegcode_hal_settings wish;
  struct shapegcode_hal_status status;
  int joints = personality ? personality : 1, i;

  wish.enabled = enable;
  wish.family_number = family;
  wish.fade_s = fade;
  wish.period_s = fperiod;
  for (i = 0; i < SHAPEGCODE_HAL_MODES; i++) {
    wish.frequency_hz[i] = frequency(i);
    wish.damping_ratio[i] = damping(i);
  }
  for (i = 0; i < joints; i++) command[i] = in(i);
  shapegcode_hal_run(shaper, joints, &wish, command, shaped, &status);
  for (i = 0; i < joints; i++) {
    out(i) = shaped[i];
    lag(i) = command[i] - shaped[i];
  }
  ok = status.possible;
  pending = status.waiting;
  delay = status.delay_s;
  duration = status.duration_s;
}
