// Texts for the codes of the C interface.
#include "shapegcode/shapegcode.h"

int shapegcode_c_version(void) { return SHAPEGCODE_C_VERSION; }

const char* shapegcode_status_text(int code) {
  switch (code) {
    case SHAPEGCODE_OK:
      return "done";
    case SHAPEGCODE_QUEUE_FULL:
      return "the queue is full: push it again later";
    case SHAPEGCODE_NOT_CONNECTED:
      return "the segment does not start where the one before ended";
    case SHAPEGCODE_NO_LENGTH:
      return "the segment moves no axis";
    case SHAPEGCODE_NO_FEED:
      return "the feed must be finite and above zero";
    case SHAPEGCODE_NOT_FINITE:
      return "a position, a centre or a sweep is not finite";
    case SHAPEGCODE_WRONG_AXES:
      return "not as many following axes as the settings have";
    case SHAPEGCODE_AFTER_ABORT:
      return "nothing is taken between abort and restart";
    case SHAPEGCODE_NO_ARC:
      return "the arc has no radius, no sweep or no plane, or its sweep does not lead to its end";
    case SHAPEGCODE_NO_TIME:
      return "a dwell takes 0 to 1e6 s";
    case SHAPEGCODE_FLUSHING:
      return "the motion is flushed: push it again when it rests";
    case SHAPEGCODE_BEYOND_TRAVEL:
      return "it leads out of the travel of an axis";
    case SHAPEGCODE_BAD_LIMIT:
      return "a limit of the rules is not above zero";
    case SHAPEGCODE_NOT_STRAIGHT:
      return "what is bound to the spindle must be a line";
    case SHAPEGCODE_PATH_MOVES:
      return "an axis is jogged while the path is held, flushed or aborted and rests";
    case SHAPEGCODE_NO_AXIS:
      return "there is no such axis, or it has no such limits";
    case SHAPEGCODE_NO_SPEED:
      return "the speed is not above zero";
    case SHAPEGCODE_NO_RECORD:
      return "no periods are kept for retrace";
    case SHAPEGCODE_ERROR_ARGUMENT:
      return "a value is outside its range";
    case SHAPEGCODE_ERROR_NULL:
      return "a pointer is NULL that must not be";
    case SHAPEGCODE_ERROR_STRUCT_SIZE:
      return "a struct that was not initialised, holds an unknown code, or is of a newer header than the library";
    case SHAPEGCODE_ERROR_OUT_OF_MEMORY:
      return "out of memory";
    case SHAPEGCODE_ERROR_INTERNAL:
      return "a defect of the library";
    default:
      return "an unknown code";
  }
}

const char* shapegcode_activity_text(int activity) {
  switch (activity) {
    case SHAPEGCODE_IDLE:
      return "idle";
    case SHAPEGCODE_MOVING:
      return "moving";
    case SHAPEGCODE_STOPPING:
      return "stopping";
    case SHAPEGCODE_HELD:
      return "held";
    case SHAPEGCODE_STARVED:
      return "starved";
    case SHAPEGCODE_ABORTED:
      return "aborted";
    case SHAPEGCODE_JOGGING:
      return "jogging";
    default:
      return "unknown";
  }
}
