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

static struct shapegcode_hal *made[64];
static int made_count;

static void report(const char *line) { rtapi_print_msg(RTAPI_MSG_ERR, "shapegcode_shaper: %s\n", line); }

EXTRA_SETUP() {
  int joints = personality ? personality : 1;
  (void)prefix;
  (void)extra_arg;
  if (joints < 1 || joints > 9 || made_count == 64) {
    rtapi_print_msg(RTAPI_MSG_ERR, "shapegcode_shaper: personality %d, 1 to 9 joints needed\n", joints);
    return -EINVAL;
  }
  shaper = shapegcode_hal_create(joints, report);
  if (!shaper) return -ENOMEM;
  made[made_count++] = shaper;
  return 0;
}

EXTRA_CLEANUP() {
  struct __comp_state *__comp_inst; /* the name that halcompile's `shaper` stands for a member of */
  /* The servo thread may run still: it passes commands on from here on. */
  for (__comp_inst = __comp_first_inst; __comp_inst; __comp_inst = __comp_inst->_next)
    __atomic_store_n(&shaper, (void *)0, __ATOMIC_RELEASE);
  while (made_count > 0) shapegcode_hal_destroy(made[--made_count]);
}

FUNCTION(_) {
  double command[9], shaped[9];
  struct shapegcode_hal_settings wish;
  struct shapegcode_hal_status status;
  struct shapegcode_hal *hal = __atomic_load_n(&shaper, __ATOMIC_ACQUIRE);
  int joints = personality ? personality : 1, i;

  if (!hal) {
    for (i = 0; i < joints; i++) {
      out(i) = in(i);
      lag(i) = 0.0;
    }
    return;
  }
  wish.enabled = enable;
  wish.family_number = family;
  wish.fade_s = fade;
  wish.period_s = fperiod;
  for (i = 0; i < SHAPEGCODE_HAL_MODES; i++) {
    wish.frequency_hz[i] = frequency(i);
    wish.damping_ratio[i] = damping(i);
  }
  for (i = 0; i < joints; i++) command[i] = in(i);
  shapegcode_hal_step(hal, &wish, command, shaped, &status);
  for (i = 0; i < joints; i++) {
    out(i) = shaped[i];
    lag(i) = command[i] - shaped[i];
  }
  ok = status.possible;
  pending = status.waiting;
  delay = status.delay_s;
  duration = status.duration_s;
}
