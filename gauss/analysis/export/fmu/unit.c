/* Functional mock-up unit (FMI 3.0, model exchange and co-simulation) of the equations of motion in model.h.

   Variables by their value references: 0 time, 1 … N states, N + 1 … 2N their derivatives, then inputs and parameters, then
   outputs.
   Co-simulation integrates by Dormand and Prince's pair 5(4) with step control, and projects each step onto the constraints;
   with model exchange, states are projected in event mode, for which the unit asks where they have left the constraints. */
#include "model.h"

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#define N UNIT_STATES
#define M UNIT_INPUTS
#define P UNIT_OUTPUTS
#define DEFAULT_TOLERANCE 1e-8 /* of the local error of a step, relative and absolute */
#define DRIFT 1e-10            /* distance of a state to its projection from which event mode is asked for */
#define LEAST_STEP 1e-12       /* of a communication step: shorter ones do not converge */
#define EXPORT __attribute__((visibility("default")))

typedef enum { OK, Warning, Discard, Error, Fatal } Status;

typedef struct {
    double t, tolerance, h;
    double x[N], rate[N], u[M + 1], y[P + 1]; /* one more: arrays of no entries are no C */
    bool current;                             /* whether rates and outputs are those of the state */
} Unit;

static void reset(Unit *unit)
{
    memset(unit, 0, sizeof *unit);
    unit->tolerance = DEFAULT_TOLERANCE;
    memcpy(unit->x, unit_start, sizeof unit_start);
    memcpy(unit->u, unit_given, sizeof unit_given);
}

static void evaluate(Unit *unit)
{
    if (!unit->current)
        unit_rates(unit->t, unit->x, unit->u, unit->rate, unit->y);
    unit->current = true;
}

/* Distance to the constraints; the state is projected. */
static double project(Unit *unit)
{
    double x[N], moved = 0.0;
    unit_project(unit->t, unit->x, unit->u, x);
    for (int k = 0; k < N; ++k)
        moved = fmax(moved, fabs(x[k] - unit->x[k]));
    memcpy(unit->x, x, sizeof x);
    unit->current = false;
    return moved;
}

/* One step of Dormand and Prince; the largest error relative to the tolerance. */
static double dormand_prince(const Unit *unit, double h, double *end)
{
    static const double c[7] = {0.0, 0.2, 0.3, 0.8, 8.0 / 9.0, 1.0, 1.0};
    static const double a[7][6] = {
        {0.0},
        {0.2},
        {3.0 / 40.0, 9.0 / 40.0},
        {44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0},
        {19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0},
        {9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0},
        {35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0}};
    static const double e[7] = {71.0 / 57600.0, 0.0, -71.0 / 16695.0, 71.0 / 1920.0, -17253.0 / 339200.0, 22.0 / 525.0, -1.0 / 40.0};
    double slopes[7][N], y[P + 1], worst = 0.0;
    for (int i = 0; i < 7; ++i) {
        for (int k = 0; k < N; ++k) {
            double total = 0.0;
            for (int j = 0; j < i; ++j)
                total += a[i][j] * slopes[j][k];
            end[k] = unit->x[k] + h * total;
        }
        unit_rates(unit->t + c[i] * h, end, unit->u, slopes[i], y);
    }
    for (int k = 0; k < N; ++k) {
        double error = 0.0;
        for (int i = 0; i < 7; ++i)
            error += e[i] * slopes[i][k];
        error = fabs(h * error) / (unit->tolerance * (1.0 + fmax(fabs(unit->x[k]), fabs(end[k]))));
        worst = error <= worst ? worst : error; /* an error that is no number is the worst */
    }
    return worst;
}

static Status advance(Unit *unit, double end, double shortest)
{
    if (unit->h <= 0.0)
        unit->h = end - unit->t;
    while (unit->t < end) {
        double x[N], left = end - unit->t, h = unit->h < left ? unit->h : left;
        const double error = dormand_prince(unit, h, x);
        const double factor = error > 0.0 ? 0.9 * pow(error, -0.2) : 5.0;
        if (error <= 1.0) {
            memcpy(unit->x, x, sizeof x);
            unit->t = h < left ? unit->t + h : end;
            project(unit);
        }
        if (!(error <= 1.0) || h == unit->h || factor < 1.0)
            unit->h = h * (factor > 5.0 ? 5.0 : factor > 0.2 ? factor : 0.2);
        if (!(unit->h >= shortest))
            return Error;
    }
    return OK;
}

static double *place(Unit *unit, uint32_t reference)
{
    if (reference == 0)
        return &unit->t;
    if (reference <= N)
        return &unit->x[reference - 1];
    if (reference <= 2 * N) {
        evaluate(unit);
        return &unit->rate[reference - N - 1];
    }
    if (reference <= 2 * N + M)
        return &unit->u[reference - 2 * N - 1];
    if (reference <= 2 * N + M + P) {
        evaluate(unit);
        return &unit->y[reference - 2 * N - M - 1];
    }
    return NULL;
}

static void *instantiate(const char *token)
{
    Unit *unit = strcmp(token, unit_token) ? NULL : malloc(sizeof(Unit));
    if (unit)
        reset(unit);
    return unit;
}

EXPORT const char *fmi3GetVersion(void) { return "3.0"; }

EXPORT void *fmi3InstantiateModelExchange(const char *name, const char *token, const char *resources, bool visible,
                                          bool logging, void *environment, void *log)
{
    (void)name, (void)resources, (void)visible, (void)logging, (void)environment, (void)log;
    return instantiate(token);
}

EXPORT void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible, bool logging,
                                         bool events, bool early, const uint32_t *intermediate, size_t count,
                                         void *environment, void *log, void *update)
{
    (void)name, (void)resources, (void)visible, (void)logging, (void)events, (void)early, (void)intermediate, (void)count;
    (void)environment, (void)log, (void)update;
    return instantiate(token);
}

EXPORT void *fmi3InstantiateScheduledExecution(const char *name, const char *token, const char *resources, bool visible,
                                               bool logging, void *environment, void *log, void *clock, void *lock,
                                               void *unlock)
{
    (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)environment, (void)log;
    (void)clock, (void)lock, (void)unlock;
    return NULL;
}

EXPORT void fmi3FreeInstance(void *instance) { free(instance); }

EXPORT Status fmi3Reset(void *instance)
{
    reset(instance);
    return OK;
}

EXPORT Status fmi3EnterInitializationMode(void *instance, bool has_tolerance, double tolerance, double start, bool has_stop,
                                          double stop)
{
    Unit *unit = instance;
    (void)has_stop, (void)stop;
    unit->t = start;
    unit->current = false;
    if (has_tolerance)
        unit->tolerance = tolerance;
    return OK;
}

EXPORT Status fmi3ExitInitializationMode(void *instance)
{
    project(instance);
    return OK;
}

EXPORT Status fmi3GetFloat64(void *instance, const uint32_t *references, size_t count, double *values, size_t size)
{
    if (size != count)
        return Error;
    for (size_t k = 0; k < count; ++k) {
        const double *found = place(instance, references[k]);
        if (!found)
            return Error;
        values[k] = *found;
    }
    return OK;
}

EXPORT Status fmi3SetFloat64(void *instance, const uint32_t *references, size_t count, const double *values, size_t size)
{
    Unit *unit = instance;
    if (size != count)
        return Error;
    for (size_t k = 0; k < count; ++k) {
        const uint32_t reference = references[k];
        if (!reference || (reference > N && reference <= 2 * N) || reference > 2 * N + M)
            return Error; /* time, derivatives and outputs are computed */
        *place(unit, reference) = values[k];
    }
    unit->current = false;
    return OK;
}

EXPORT Status fmi3SetTime(void *instance, double time)
{
    Unit *unit = instance;
    unit->t = time;
    unit->current = false;
    return OK;
}

EXPORT Status fmi3SetContinuousStates(void *instance, const double *x, size_t count)
{
    Unit *unit = instance;
    if (count != N)
        return Error;
    memcpy(unit->x, x, sizeof unit->x);
    unit->current = false;
    return OK;
}

EXPORT Status fmi3GetContinuousStates(void *instance, double *x, size_t count)
{
    if (count != N)
        return Error;
    memcpy(x, ((Unit *)instance)->x, N * sizeof *x);
    return OK;
}

EXPORT Status fmi3GetContinuousStateDerivatives(void *instance, double *rate, size_t count)
{
    if (count != N)
        return Error;
    evaluate(instance);
    memcpy(rate, ((Unit *)instance)->rate, N * sizeof *rate);
    return OK;
}

EXPORT Status fmi3GetNominalsOfContinuousStates(void *instance, double *nominals, size_t count)
{
    (void)instance;
    if (count != N)
        return Error;
    for (int k = 0; k < N; ++k)
        nominals[k] = 1.0;
    return OK;
}

EXPORT Status fmi3GetNumberOfContinuousStates(void *instance, size_t *count)
{
    (void)instance;
    *count = N;
    return OK;
}

EXPORT Status fmi3GetNumberOfEventIndicators(void *instance, size_t *count)
{
    (void)instance;
    *count = 0;
    return OK;
}

EXPORT Status fmi3GetEventIndicators(void *instance, double *indicators, size_t count)
{
    (void)instance, (void)indicators;
    return count ? Error : OK;
}

EXPORT Status fmi3CompletedIntegratorStep(void *instance, bool no_set, bool *event, bool *terminate)
{
    Unit unit = *(Unit *)instance;
    (void)no_set;
    *event = project(&unit) > DRIFT;
    *terminate = false;
    return OK;
}

EXPORT Status fmi3UpdateDiscreteStates(void *instance, bool *again, bool *terminate, bool *nominals, bool *values,
                                       bool *timed, double *next)
{
    (void)next;
    *again = *terminate = *nominals = *timed = false;
    *values = project(instance) > 0.0;
    return OK;
}

EXPORT Status fmi3DoStep(void *instance, double t, double step, bool no_set, bool *event, bool *terminate, bool *early,
                         double *reached)
{
    Unit *unit = instance;
    (void)no_set;
    *event = *terminate = *early = false;
    unit->t = t;
    unit->current = false;
    const Status found = advance(unit, t + step, LEAST_STEP * step);
    *reached = unit->t;
    return found;
}

#define SIMPLE(name)                     \
    EXPORT Status name(void *instance)   \
    {                                    \
        (void)instance;                  \
        return OK;                       \
    }
SIMPLE(fmi3EnterEventMode)
SIMPLE(fmi3EnterContinuousTimeMode)
SIMPLE(fmi3EnterStepMode)
SIMPLE(fmi3EnterConfigurationMode)
SIMPLE(fmi3ExitConfigurationMode)
SIMPLE(fmi3EvaluateDiscreteStates)
SIMPLE(fmi3Terminate)

EXPORT Status fmi3SetDebugLogging(void *instance, bool on, size_t count, const char *const *categories)
{
    (void)instance, (void)on, (void)count, (void)categories;
    return OK;
}

/* Variables of other types, clocks, saved states and derivatives: there are none. Callers pass more arguments, which the
   calling conventions of all machines of the table in unit.py leave in registers or to the caller. */
#define NOT_SUPPORTED(name)              \
    EXPORT Status name(void *instance)   \
    {                                    \
        (void)instance;                  \
        return Error;                    \
    }
#define ACCESS(type) NOT_SUPPORTED(fmi3Get##type) NOT_SUPPORTED(fmi3Set##type)
ACCESS(Float32)
ACCESS(Int8)
ACCESS(UInt8)
ACCESS(Int16)
ACCESS(UInt16)
ACCESS(Int32)
ACCESS(UInt32)
ACCESS(Int64)
ACCESS(UInt64)
ACCESS(Boolean)
ACCESS(String)
ACCESS(Binary)
ACCESS(Clock)
ACCESS(FMUState)
ACCESS(IntervalDecimal)
ACCESS(IntervalFraction)
ACCESS(ShiftDecimal)
ACCESS(ShiftFraction)
NOT_SUPPORTED(fmi3FreeFMUState)
NOT_SUPPORTED(fmi3SerializedFMUStateSize)
NOT_SUPPORTED(fmi3SerializeFMUState)
NOT_SUPPORTED(fmi3DeserializeFMUState)
NOT_SUPPORTED(fmi3GetNumberOfVariableDependencies)
NOT_SUPPORTED(fmi3GetVariableDependencies)
NOT_SUPPORTED(fmi3GetDirectionalDerivative)
NOT_SUPPORTED(fmi3GetAdjointDerivative)
NOT_SUPPORTED(fmi3GetOutputDerivatives)
NOT_SUPPORTED(fmi3ActivateModelPartition)
