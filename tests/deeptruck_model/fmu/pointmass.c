/* A truck as a point mass, for FMI 2 or 3 (-DFMI=2 or 3): no state to get or set, no recorded speed to take.

   mass * v' = gear * torque - 0.5 * 1.2 * drag * v^2 - 9.81 * mass * (rolling + slope) - pedal * brake,
   in steps of 0.01 s, and never backwards. A step from another time than its own is an error. Numbers of variables, from 0:
   torque (N m), pedal (percent), slope, v (m/s), mass, drag, rolling, v_start, brake (N at the full pedal) */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#if FMI == 2
#include "fmi2Functions.h"
typedef fmi2Status Status;
typedef fmi2ValueReference Reference;
#define OK fmi2OK
#define WRONG fmi2Error
#else
#include "fmi3Functions.h"
typedef fmi3Status Status;
typedef fmi3ValueReference Reference;
#define OK fmi3OK
#define WRONG fmi3Error
#endif

enum { TORQUE, PEDAL, SLOPE, V, MASS, DRAG, ROLLING, V_START, BRAKE, COUNT };
static const double START[COUNT] = {0, 0, 0, 0, 20000, 6, 0.006, 0, 120000};
static const double STEP = 0.01, GEAR = 20, GRAVITY = 9.81, AIR = 1.2;
typedef struct { double x[COUNT], clock; } Truck;

static void again(Truck *t) { memcpy(t->x, START, sizeof START); t->clock = 0; }
static Truck *made(void) { Truck *t = malloc(sizeof *t); again(t); return t; }

static Status drive(Truck *t, double at, double seconds) {
  double *x = t->x;
  if (fabs(at - t->clock) > 1e-6) return WRONG;
  t->clock += seconds;
  for (int k = (int)(seconds / STEP + 0.5); k > 0; k--) {
    double pull = GEAR * x[TORQUE] - x[BRAKE] * x[PEDAL] / 100;
    double loss = 0.5 * AIR * x[DRAG] * x[V] * x[V] + GRAVITY * x[MASS] * (x[ROLLING] + x[SLOPE]);
    x[V] += STEP * (pull - loss) / x[MASS];
    if (x[V] < 0) x[V] = 0;
  }
  return OK;
}

static Status put(Truck *t, const Reference *which, size_t n, const double *values) {
  for (size_t i = 0; i < n; i++) {
    if (which[i] >= COUNT) return WRONG;
    t->x[which[i]] = values[i];
  }
  return OK;
}

static Status get(Truck *t, const Reference *which, size_t n, double *values) {
  for (size_t i = 0; i < n; i++) {
    if (which[i] >= COUNT) return WRONG;
    values[i] = t->x[which[i]];
  }
  return OK;
}

#if FMI == 2
fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String token, fmi2String place,
                              const fmi2CallbackFunctions *f, fmi2Boolean visible, fmi2Boolean log) { return made(); }
void fmi2FreeInstance(fmi2Component t) { free(t); }
fmi2Status fmi2Reset(fmi2Component t) { again(t); return OK; }
fmi2Status fmi2SetupExperiment(fmi2Component t, fmi2Boolean td, fmi2Real tolerance, fmi2Real begin,
                               fmi2Boolean ed, fmi2Real end) { return OK; }
fmi2Status fmi2EnterInitializationMode(fmi2Component t) { return OK; }
fmi2Status fmi2ExitInitializationMode(fmi2Component t) { ((Truck *)t)->x[V] = ((Truck *)t)->x[V_START]; return OK; }
fmi2Status fmi2Terminate(fmi2Component t) { return OK; }
fmi2Status fmi2SetReal(fmi2Component t, const Reference r[], size_t n, const fmi2Real x[]) { return put(t, r, n, x); }
fmi2Status fmi2GetReal(fmi2Component t, const Reference r[], size_t n, fmi2Real x[]) { return get(t, r, n, x); }
fmi2Status fmi2DoStep(fmi2Component t, fmi2Real at, fmi2Real dt, fmi2Boolean kept) { return drive(t, at, dt); }
#else
fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String name, fmi3String token, fmi3String place, fmi3Boolean visible, fmi3Boolean log, fmi3Boolean events,
    fmi3Boolean early, const Reference needed[], size_t n, fmi3InstanceEnvironment e,
    fmi3LogMessageCallback said, fmi3IntermediateUpdateCallback update) { return made(); }
void fmi3FreeInstance(fmi3Instance t) { free(t); }
fmi3Status fmi3Reset(fmi3Instance t) { again(t); return OK; }
fmi3Status fmi3EnterInitializationMode(fmi3Instance t, fmi3Boolean td, fmi3Float64 tolerance, fmi3Float64 begin,
                                       fmi3Boolean ed, fmi3Float64 end) { return OK; }
fmi3Status fmi3ExitInitializationMode(fmi3Instance t) { ((Truck *)t)->x[V] = ((Truck *)t)->x[V_START]; return OK; }
fmi3Status fmi3Terminate(fmi3Instance t) { return OK; }
fmi3Status fmi3SetFloat64(fmi3Instance t, const Reference r[], size_t n, const fmi3Float64 x[], size_t m) { return put(t, r, n, x); }
fmi3Status fmi3GetFloat64(fmi3Instance t, const Reference r[], size_t n, fmi3Float64 x[], size_t m) { return get(t, r, n, x); }
fmi3Status fmi3DoStep(fmi3Instance t, fmi3Float64 at, fmi3Float64 dt, fmi3Boolean kept, fmi3Boolean *event,
                      fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *reached) {
  *event = *terminate = *early = 0;
  *reached = at + dt;
  return drive(t, at, dt);
}
#endif
