// Inverse kinematics of cable-driven parallel robots with six sagging cables, for the firmware of the
// winches. SI units. Made by cbindgen from core/c/src, and compared with it by the tests.
//
// Every function comes for float (cdpr_f32_) and double (cdpr_f64_). The caller owns all memory.
// Nothing is allocated, nothing is global, no call blocks, and each takes a bounded time.


#ifndef CDPR_H
#define CDPR_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

// Version of this header: major << 16 | minor << 8 | patch.
#define CDPR_VERSION 256

// Size of a `float` tracker in 64-bit words.
#define CDPR_F32_TRACKER_WORDS 192

// Size of a `double` tracker in 64-bit words.
#define CDPR_F64_TRACKER_WORDS 384

// Number of cables.
#define CDPR_CABLES 6

// Why a call did not do what it was asked.
enum cdpr_code
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // All is well.
    CDPR_CODE_OK = 0,
    // A pointer is null, or not aligned as its type asks.
    CDPR_CODE_BAD_POINTER = 1,
    // This tracker has not been started, or its start has failed.
    CDPR_CODE_NOT_STARTED = 2,
    // Weight or compliance of `cable` is negative or not finite.
    CDPR_CODE_INVALID_CABLE = 3,
    // A coordinate of `cable` is not finite.
    CDPR_CODE_NON_FINITE_CABLE = 4,
    // `cable` and `other_cable` leave from the same anchor.
    CDPR_CODE_COINCIDENT_ANCHORS = 5,
    // All attachments lie on one line, about which no set of cables can balance a moment.
    CDPR_CODE_COLLINEAR_ATTACHMENTS = 6,
    // The measured length of `cable` is not positive and finite, or (-1) the tolerance is not.
    CDPR_CODE_INVALID_MEASUREMENT = 7,
    // There is no equilibrium near the measured lengths, or none was found. Of the nearest one,
    // `cable` is the furthest off, by `value`, m. -1: none at all.
    CDPR_CODE_NO_SOLUTION_NEAR_LENGTHS = 8,
    // A number of the set-point is infinite or NaN.
    CDPR_CODE_NON_FINITE_SET_POINT = 10,
    // The position is not finite, or the quaternion is not of unit length.
    CDPR_CODE_INVALID_POSE = 11,
    // No set-point has come for longer than allowed. `value`: ticks since the last one.
    CDPR_CODE_STALE_SET_POINT = 12,
    // The set-point lies further from the last pose than a tick may move. `value`: distance of the
    // platform origin, m; `other_value`: largest move of an attachment by turning, m.
    CDPR_CODE_JUMPING_SET_POINT = 20,
    // The rest length of `cable` would change too fast. `value`: speed wanted, m/s.
    CDPR_CODE_SPEED_BEYOND_WINCH = 21,
    // The equations are not met to rounding. `value`: largest distance between the end of a cable and
    // its attachment, m; `other_value`: unbalanced wrench, moments over the moment arm, N.
    CDPR_CODE_RESIDUAL_NOT_MET = 22,
    // That the solution belongs to the branch could not be proven. `value`: the contraction found;
    // below one half is needed.
    CDPR_CODE_NOT_CERTIFIED = 23,
    // At this pose the attachment of `cable` lies on its anchor.
    CDPR_CODE_ATTACHMENT_ON_ANCHOR = 30,
    // The tension of `cable` vanishes somewhere along it.
    CDPR_CODE_SINGULAR_CABLE = 31,
    // The cables cannot balance every wrench: a fold, or a singular posture.
    CDPR_CODE_SINGULAR_STATICS = 32,
    // `cable` would have no positive rest length.
    CDPR_CODE_LENGTH_NOT_POSITIVE = 33,
    // The cables hardly hold the platform against some wrench. `value`: how much the matrix of tangent
    // wrenches may change before it is singular, between 0 and 1.
    CDPR_CODE_NEAR_SINGULARITY = 34,
    // At the present speed this branch ends in a fold. `value`: time to it, s.
    CDPR_CODE_FOLD_AHEAD = 35,
    // A tension of `cable` is above its limit. `value`: the larger one of its ends, N.
    CDPR_CODE_TENSION_ABOVE = 36,
    // The tension of `cable` at its anchor is below its limit. `value`: that tension, N.
    CDPR_CODE_TENSION_BELOW = 37,
    // `cable` is longer or shorter than its winch can hold. `value`: rest length wanted, m.
    CDPR_CODE_LENGTH_BEYOND_WINCH = 38,
    // The bytes are no warm-start table of the version that this library reads, or they have been damaged.
    CDPR_CODE_BAD_TABLE = 40,
    // The table was made for a robot with another `cable`, or (-1) for another load or cable model.
    CDPR_CODE_OTHER_ROBOT = 41,
    // The pose is in no cell of the table, and no way of `way_parts` parts was found that leads there from one.
    CDPR_CODE_NOT_IN_TABLE = 42,
    // Something this interface has no name for; the remedy holds all the same.
    CDPR_CODE_OTHER = 99,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum cdpr_code cdpr_code;
#else
typedef int32_t cdpr_code;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// What is to be done after a call that failed.
enum cdpr_remedy
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // Nothing: all is well.
    CDPR_REMEDY_NONE = 0,
    // The call was given something wrong: mend the program, the robot or the measurement.
    CDPR_REMEDY_MEND_CALL = 1,
    // Stand still; a sound set-point near the last pose is taken as if nothing had been.
    CDPR_REMEDY_MEND_SET_POINT = 2,
    // The pose is right but the way there too fast: the same in smaller steps is taken.
    CDPR_REMEDY_GO_SLOWER = 3,
    // This pose is not to be had on this branch: go back the way.
    CDPR_REMEDY_GO_BACK = 4,
    // The warm-start table cannot be used: write the right one.
    CDPR_REMEDY_REPLACE_TABLE = 5,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum cdpr_remedy cdpr_remedy;
#else
typedef int32_t cdpr_remedy;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// The outcome of a call.
typedef struct {
    // What happened.
    cdpr_code code;
    // What is to be done.
    cdpr_remedy remedy;
    // The cable in question, counted from 0; -1 where there is none.
    int32_t cable;
    // The other cable, where two are in question; -1 otherwise.
    int32_t other_cable;
    // How much: see the code. 0 where it says nothing.
    float value;
    // How much of something else: see the code. 0 where it says nothing.
    float other_value;
} cdpr_f32_status;

// A tracker in `float`: follows one branch, six rest lengths at each tick, each proven.
//
// Its memory is the caller's and its contents are not: set it to zero (a `static` is) and start it. It
// holds no pointers and may be copied. Two threads may not use the same one at the same time.
typedef struct {
    uint64_t words[CDPR_F32_TRACKER_WORDS];
} cdpr_f32_tracker;

// One cable: where it starts, where it holds the platform, and what it is made of.
typedef struct {
    // Anchor, where the cable leaves its winch: world frame, z up, m.
    float anchor_m[3];
    // Attachment, where the cable holds the platform: platform frame, m.
    float attachment_m[3];
    // Weight of the cable per rest length, N/m: its mass per metre times gravity.
    float weight_n_m;
    // Reciprocal of the axial stiffness, 1/EA, 1/N. Zero: the cable does not stretch.
    float compliance_per_n;
} cdpr_f32_cable;

// The robot: six elastic catenaries.
typedef struct {
    // The cables.
    cdpr_f32_cable cables[CDPR_CABLES];
} cdpr_f32_robot;

// What the platform carries.
typedef struct {
    // Mass of platform and payload, kg.
    float mass_kg;
    // Centre of mass: platform frame, m.
    float center_of_mass_m[3];
    // Gravity, m/s^2, positive, acting along world -z.
    float gravity_m_s2;
    // Any further force on the platform, at its origin: world frame, N.
    float force_n[3];
    // Any further moment on the platform: world frame, N m.
    float moment_nm[3];
} cdpr_f32_load;

// What one winch and its cable can do.
typedef struct {
    // Shortest rest length, m.
    float shortest_m;
    // Longest rest length, m: what the drum holds.
    float longest_m;
    // Largest rate of the rest length either way, m/s.
    float fastest_m_s;
    // Lowest tension at the anchor, N.
    float lowest_tension_n;
    // Highest tension at either end, N.
    float highest_tension_n;
} cdpr_f32_cable_limits;

// Rate and limits.
typedef struct {
    // Time between two ticks, s.
    float period_s;
    // Largest move of the platform origin in a tick, and of an attachment by turning, m.
    float largest_move_m;
    // Least distance to a singularity, between 0 and 1: see `CDPR_CODE_NEAR_SINGULARITY`.
    float least_distance;
    // A fold that would be reached sooner than this is refused, s: see `CDPR_CODE_FOLD_AHEAD`.
    float fold_horizon_s;
    // Largest `existence_n` of a cable that is accepted, N: rounding leaves about 0.05 in f32 with a load of
    // 70 kg, and 1e-10 in f64.
    float largest_error_n;
    // Limits of the cables.
    cdpr_f32_cable_limits cables[CDPR_CABLES];
} cdpr_f32_settings;

// Where the platform should be, and how fast it should move there.
typedef struct {
    // Position of the platform origin: world frame, m.
    float position_m[3];
    // Orientation, platform to world: unit quaternion w, x, y, z. {1, 0, 0, 0} is level.
    float orientation[4];
    // Velocity of the platform origin: world frame, m/s.
    float velocity_m_s[3];
    // Angular velocity: world frame, rad/s.
    float angular_velocity_rad_s[3];
} cdpr_f32_set_point;

// Force and rest length of one cable.
typedef struct {
    // Force on the cable at the attachment, N, in the vertical plane of the cable: outwards from the
    // anchor, and up. A downward force carries the platform.
    float force_n[2];
    // Rest (unstretched) length from the anchor to the attachment, m.
    float rest_length_m;
} cdpr_f32_cable_state;

// What one winch is to do, and what its cable then carries.
typedef struct {
    // Rest length from the anchor to the attachment, m.
    float rest_length_m;
    // Its rate of change at the velocities of the set-point, for speed feed-forward, m/s.
    float rest_length_rate_m_s;
    // Horizontal direction from the anchor to the attachment, world x and y.
    float direction[2];
    // Force on the cable at the attachment, N: outwards from the anchor, and up.
    float force_n[2];
    // Its rate of change, N/s.
    float force_rate_n_s[2];
    // Force of the cable on its winch at the anchor, N: outwards, and up.
    float anchor_force_n[2];
    // Tension at the attachment, N.
    float tension_n;
    // Tension at the anchor, N.
    float anchor_tension_n;
    // Whether the cable hangs below both of its ends.
    bool is_slack;
} cdpr_f32_cable_command;

// What is proven about a command.
typedef struct {
    // Kantorovich's h: at most 1/4.
    float h;
    // Contraction over the ball and all poses since the last command: at most 0.44.
    float contraction;
    // There is a solution at which no cable's force is further from the command than this, N along its force curve.
    float existence_n[CDPR_CABLES];
    // And no other at which none is further than so many times that.
    float uniqueness_ratio;
} cdpr_f32_certificate;

// The outcome of a tick.
typedef struct {
    // One for each winch.
    cdpr_f32_cable_command cables[CDPR_CABLES];
    // What is proven about it.
    cdpr_f32_certificate certificate;
    // Distance to a singularity, between 0 and 1: see `CDPR_CODE_NEAR_SINGULARITY`.
    float distance;
    // Largest distance between the end of a cable and its attachment, before the last step, m.
    float closure_m;
    // Unbalanced wrench before the last step, moments over the moment arm, N.
    float imbalance_n;
    // Parts into which the move was divided.
    uint32_t parts;
} cdpr_f32_command;

// The outcome of a call.
typedef struct {
    // What happened.
    cdpr_code code;
    // What is to be done.
    cdpr_remedy remedy;
    // The cable in question, counted from 0; -1 where there is none.
    int32_t cable;
    // The other cable, where two are in question; -1 otherwise.
    int32_t other_cable;
    // How much: see the code. 0 where it says nothing.
    double value;
    // How much of something else: see the code. 0 where it says nothing.
    double other_value;
} cdpr_f64_status;

// A tracker in `double`: see the one in `float`.
typedef struct {
    uint64_t words[CDPR_F64_TRACKER_WORDS];
} cdpr_f64_tracker;

// One cable: where it starts, where it holds the platform, and what it is made of.
typedef struct {
    // Anchor, where the cable leaves its winch: world frame, z up, m.
    double anchor_m[3];
    // Attachment, where the cable holds the platform: platform frame, m.
    double attachment_m[3];
    // Weight of the cable per rest length, N/m: its mass per metre times gravity.
    double weight_n_m;
    // Reciprocal of the axial stiffness, 1/EA, 1/N. Zero: the cable does not stretch.
    double compliance_per_n;
} cdpr_f64_cable;

// The robot: six elastic catenaries.
typedef struct {
    // The cables.
    cdpr_f64_cable cables[CDPR_CABLES];
} cdpr_f64_robot;

// What the platform carries.
typedef struct {
    // Mass of platform and payload, kg.
    double mass_kg;
    // Centre of mass: platform frame, m.
    double center_of_mass_m[3];
    // Gravity, m/s^2, positive, acting along world -z.
    double gravity_m_s2;
    // Any further force on the platform, at its origin: world frame, N.
    double force_n[3];
    // Any further moment on the platform: world frame, N m.
    double moment_nm[3];
} cdpr_f64_load;

// What one winch and its cable can do.
typedef struct {
    // Shortest rest length, m.
    double shortest_m;
    // Longest rest length, m: what the drum holds.
    double longest_m;
    // Largest rate of the rest length either way, m/s.
    double fastest_m_s;
    // Lowest tension at the anchor, N.
    double lowest_tension_n;
    // Highest tension at either end, N.
    double highest_tension_n;
} cdpr_f64_cable_limits;

// Rate and limits.
typedef struct {
    // Time between two ticks, s.
    double period_s;
    // Largest move of the platform origin in a tick, and of an attachment by turning, m.
    double largest_move_m;
    // Least distance to a singularity, between 0 and 1: see `CDPR_CODE_NEAR_SINGULARITY`.
    double least_distance;
    // A fold that would be reached sooner than this is refused, s: see `CDPR_CODE_FOLD_AHEAD`.
    double fold_horizon_s;
    // Largest `existence_n` of a cable that is accepted, N: rounding leaves about 0.05 in f32 with a load of
    // 70 kg, and 1e-10 in f64.
    double largest_error_n;
    // Limits of the cables.
    cdpr_f64_cable_limits cables[CDPR_CABLES];
} cdpr_f64_settings;

// Where the platform should be, and how fast it should move there.
typedef struct {
    // Position of the platform origin: world frame, m.
    double position_m[3];
    // Orientation, platform to world: unit quaternion w, x, y, z. {1, 0, 0, 0} is level.
    double orientation[4];
    // Velocity of the platform origin: world frame, m/s.
    double velocity_m_s[3];
    // Angular velocity: world frame, rad/s.
    double angular_velocity_rad_s[3];
} cdpr_f64_set_point;

// Force and rest length of one cable.
typedef struct {
    // Force on the cable at the attachment, N, in the vertical plane of the cable: outwards from the
    // anchor, and up. A downward force carries the platform.
    double force_n[2];
    // Rest (unstretched) length from the anchor to the attachment, m.
    double rest_length_m;
} cdpr_f64_cable_state;

// What one winch is to do, and what its cable then carries.
typedef struct {
    // Rest length from the anchor to the attachment, m.
    double rest_length_m;
    // Its rate of change at the velocities of the set-point, for speed feed-forward, m/s.
    double rest_length_rate_m_s;
    // Horizontal direction from the anchor to the attachment, world x and y.
    double direction[2];
    // Force on the cable at the attachment, N: outwards from the anchor, and up.
    double force_n[2];
    // Its rate of change, N/s.
    double force_rate_n_s[2];
    // Force of the cable on its winch at the anchor, N: outwards, and up.
    double anchor_force_n[2];
    // Tension at the attachment, N.
    double tension_n;
    // Tension at the anchor, N.
    double anchor_tension_n;
    // Whether the cable hangs below both of its ends.
    bool is_slack;
} cdpr_f64_cable_command;

// What is proven about a command.
typedef struct {
    // Kantorovich's h: at most 1/4.
    double h;
    // Contraction over the ball and all poses since the last command: at most 0.44.
    double contraction;
    // There is a solution at which no cable's force is further from the command than this, N along its force curve.
    double existence_n[CDPR_CABLES];
    // And no other at which none is further than so many times that.
    double uniqueness_ratio;
} cdpr_f64_certificate;

// The outcome of a tick.
typedef struct {
    // One for each winch.
    cdpr_f64_cable_command cables[CDPR_CABLES];
    // What is proven about it.
    cdpr_f64_certificate certificate;
    // Distance to a singularity, between 0 and 1: see `CDPR_CODE_NEAR_SINGULARITY`.
    double distance;
    // Largest distance between the end of a cable and its attachment, before the last step, m.
    double closure_m;
    // Unbalanced wrench before the last step, moments over the moment arm, N.
    double imbalance_n;
    // Parts into which the move was divided.
    uint32_t parts;
} cdpr_f64_command;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Version of the library: compare with `CDPR_VERSION` of the header before anything else.
uint32_t cdpr_version(void);

// A code in a few words of ASCII, for a display or a log. Never null.
const char *cdpr_text(int32_t code);

// Starts a tracker at the equilibrium that Newton's method finds from six forces and rest lengths,
// those of the last command before the power was cut, say.
//
// The first command is then to be had by `cdpr_f32_last_command`. After a failure there is no tracker.
//
// # Safety
// A pointer that is neither null nor misaligned must point to what its type says. `states`: six.
cdpr_f32_status cdpr_f32_start(cdpr_f32_tracker *tracker,
                               const cdpr_f32_robot *robot,
                               const cdpr_f32_load *load,
                               const cdpr_f32_settings *settings,
                               const cdpr_f32_set_point *set_point,
                               const cdpr_f32_cable_state *states);

// Starts a tracker without knowing any force: at the equilibrium whose rest lengths are those that the
// encoders measure, within a tolerance (m, all errors together: encoder, drum, pose).
//
// The lengths tell which of the equilibria of the pose this one is: which cables are taut and which
// hang slack. With a larger tolerance than the lengths of two equilibria differ by, either may be taken.
// Otherwise as `cdpr_f32_start`. At most five attempts of twenty Newton steps, usually one of three to seven.
//
// # Safety
// A pointer that is neither null nor misaligned must point to what its type says. `lengths_m`: six.
cdpr_f32_status cdpr_f32_start_from_lengths(cdpr_f32_tracker *tracker,
                                            const cdpr_f32_robot *robot,
                                            const cdpr_f32_load *load,
                                            const cdpr_f32_settings *settings,
                                            const cdpr_f32_set_point *set_point,
                                            const float *lengths_m,
                                            float tolerance_m);

// Starts a tracker from a warm-start table (`cdpr table build`) of so many bytes: on the sheet of the table, at the
// solution that it leads to at the pose. The table is only read, may lie in flash at any address, and is checked first,
// with about ten instructions a byte.
//
// Where it does not cover the pose and `way_parts` is not 0: at the nearest pose that it covers, and from there in at most
// so many parts, each proven and as expensive as a tick, straight to the pose. The search for that pose looks at each node
// of the table once at most. Otherwise as `cdpr_f32_start`.
//
// # Safety
// A pointer that is neither null nor misaligned must point to what its type says. `table`: `table_bytes` bytes.
cdpr_f32_status cdpr_f32_start_from_table(cdpr_f32_tracker *tracker,
                                          const cdpr_f32_robot *robot,
                                          const cdpr_f32_load *load,
                                          const cdpr_f32_settings *settings,
                                          const cdpr_f32_set_point *set_point,
                                          const uint8_t *table,
                                          size_t table_bytes,
                                          uint16_t way_parts);

// The next command. After a failure `command` is untouched and the last command stands; see the remedy.
//
// # Safety
// A pointer that is neither null nor misaligned must point to what its type says.
cdpr_f32_status cdpr_f32_tick(cdpr_f32_tracker *tracker,
                              const cdpr_f32_set_point *set_point,
                              cdpr_f32_command *command);

// The last command, the first one after a start.
//
// # Safety
// A pointer that is neither null nor misaligned must point to what its type says.
cdpr_f32_status cdpr_f32_last_command(const cdpr_f32_tracker *tracker, cdpr_f32_command *command);

// As `cdpr_f32_start`, in `double`.
//
// # Safety
// A pointer that is neither null nor misaligned must point to what its type says. `states`: six.
cdpr_f64_status cdpr_f64_start(cdpr_f64_tracker *tracker,
                               const cdpr_f64_robot *robot,
                               const cdpr_f64_load *load,
                               const cdpr_f64_settings *settings,
                               const cdpr_f64_set_point *set_point,
                               const cdpr_f64_cable_state *states);

// As `cdpr_f32_start_from_lengths`, in `double`.
//
// # Safety
// A pointer that is neither null nor misaligned must point to what its type says. `lengths_m`: six.
cdpr_f64_status cdpr_f64_start_from_lengths(cdpr_f64_tracker *tracker,
                                            const cdpr_f64_robot *robot,
                                            const cdpr_f64_load *load,
                                            const cdpr_f64_settings *settings,
                                            const cdpr_f64_set_point *set_point,
                                            const double *lengths_m,
                                            double tolerance_m);

// As `cdpr_f32_start_from_table`, in `double`.
//
// # Safety
// A pointer that is neither null nor misaligned must point to what its type says. `table`: `table_bytes` bytes.
cdpr_f64_status cdpr_f64_start_from_table(cdpr_f64_tracker *tracker,
                                          const cdpr_f64_robot *robot,
                                          const cdpr_f64_load *load,
                                          const cdpr_f64_settings *settings,
                                          const cdpr_f64_set_point *set_point,
                                          const uint8_t *table,
                                          size_t table_bytes,
                                          uint16_t way_parts);

// As `cdpr_f32_tick`, in `double`.
//
// # Safety
// A pointer that is neither null nor misaligned must point to what its type says.
cdpr_f64_status cdpr_f64_tick(cdpr_f64_tracker *tracker,
                              const cdpr_f64_set_point *set_point,
                              cdpr_f64_command *command);

// As `cdpr_f32_last_command`, in `double`.
//
// # Safety
// A pointer that is neither null nor misaligned must point to what its type says.
cdpr_f64_status cdpr_f64_last_command(const cdpr_f64_tracker *tracker, cdpr_f64_command *command);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* CDPR_H */
