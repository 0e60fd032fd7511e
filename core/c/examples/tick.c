// The tick of a winch controller: freestanding C99, the same on a microcontroller and on a host.
//
// MARIONET-CRANE carries 69 kg at (2, 7, 2.5) and moves along x by 1 mm a tick. Then the power is cut,
// and it starts again from what the encoders say.
#include "cdpr.h"
#include "print_line.h"

#include <stddef.h>

// 4 mm of steel: 0.079 kg/m, EA = 1.2566371e6 N.
#define STEEL .weight_n_m = 0.079f * 9.81f, .compliance_per_n = 1.0f / 1.2566371e6f

static const cdpr_f32_robot crane = {.cables = {
    {{-3.259f, -0.475f, 8.826f}, {-0.10f, -0.93f, -0.03f}, STEEL},
    {{9.421f, -3.482f, 11.555f}, {0.10f, -0.93f, -0.03f}, STEEL},
    {{9.538f, 3.797f, 11.533f}, {0.27f, 0.50f, -0.07f}, STEEL},
    {{5.570f, 20.414f, 8.704f}, {0.27f, 0.50f, -0.07f}, STEEL},
    {{-2.505f, 16.810f, 8.649f}, {-0.27f, 0.50f, -0.07f}, STEEL},
    {{-3.342f, 9.421f, 8.788f}, {-0.27f, 0.50f, -0.07f}, STEEL},
}};

static const cdpr_f32_load load = {.mass_kg = 69.0f, .gravity_m_s2 = 9.81f};

#define WINCH {.shortest_m = 1.0f, .longest_m = 50.0f, .fastest_m_s = 2.0f, \
               .lowest_tension_n = 5.0f, .highest_tension_n = 2000.0f}

static const cdpr_f32_settings settings = {
    .period_s = 0.001f,
    .largest_move_m = 0.01f,
    .least_distance = 1e-4f,
    .fold_horizon_s = 0.1f,
    .largest_error_n = 1.0f,
    .cables = {WINCH, WINCH, WINCH, WINCH, WINCH, WINCH},
};

// The solution at the start. A controller would have saved it when it was switched off.
static const cdpr_f32_cable_state saved[CDPR_CABLES] = {
    {{155.41469f, -114.48735f}, 10.479832f},  {{179.35776f, -129.58359f}, 15.077343f},
    {{131.30853f, -141.8301f}, 12.221567f},   {{166.6068f, -72.73922f}, 14.731523f},
    {{129.78162f, -74.298386f}, 11.970178f},  {{125.545906f, -143.95137f}, 8.355886f},
};

// Too large for a small stack; zero until it is started.
static cdpr_f32_tracker tracker;

// The set-point so many ticks after the start: level, 1 m/s along x.
static cdpr_f32_set_point path(int ticks) {
    cdpr_f32_set_point set_point = {
        // A division, not 0.001f * ticks: that may be fused with the sum on one machine and not on another.
        .position_m = {(float)(2000 + ticks) / 1000.0f, 7.0f, 2.5f},
        .orientation = {1.0f, 0.0f, 0.0f, 0.0f},
        .velocity_m_s = {1.0f, 0.0f, 0.0f},
    };
    return set_point;
}

// Writes a length below 1000 m with nine decimals, which tell every float; returns the end.
static char *write_length(char *text, float length_m) {
    uint64_t rest_nm = (uint64_t)((double)length_m * 1e9);
    for (uint64_t unit_nm = 100000000000u; unit_nm > 0; unit_nm /= 10) {
        *text++ = (char)('0' + rest_nm / unit_nm);
        rest_nm %= unit_nm;
        if (unit_nm == 1000000000u) {
            *text++ = '.';
        }
    }
    *text++ = ' ';
    return text;
}

// Where the drives would be told.
static void print_lengths(const cdpr_f32_command *command) {
    char line[CDPR_CABLES * 14 + 1];
    char *end = line;
    for (size_t i = 0; i < CDPR_CABLES; ++i) {
        end = write_length(end, command->cables[i].rest_length_m);
    }
    end[-1] = '\0';
    print_line(line);
}

// Whether all is well; says so if not. Until the next good tick the last command stands: the drives hold.
static bool is_ok(cdpr_f32_status status) {
    if (status.code == CDPR_CODE_OK) {
        return true;
    }
    print_line(cdpr_text(status.code));
    switch (status.remedy) {
    case CDPR_REMEDY_MEND_SET_POINT:
        print_line("remedy: stand still until a good set-point comes");
        break;
    case CDPR_REMEDY_GO_SLOWER:
        print_line("remedy: come again in smaller steps");
        break;
    case CDPR_REMEDY_GO_BACK:
        print_line("remedy: go back the way");
        break;
    default: // CDPR_REMEDY_MEND_CALL
        print_line("remedy: switch off and mend the program");
        break;
    }
    return false;
}

int main(void) {
    if (cdpr_version() != CDPR_VERSION) {
        print_line("header and library differ");
        return 1;
    }
    cdpr_f32_set_point set_point = path(0);
    cdpr_f32_command command;
    if (!is_ok(cdpr_f32_start(&tracker, &crane, &load, &settings, &set_point, saved))) {
        return 1;
    }
    for (int ticks = 1; ticks <= 100; ++ticks) {
        set_point = path(ticks);
        if (!is_ok(cdpr_f32_tick(&tracker, &set_point, &command))) {
            return 1;
        }
        print_lengths(&command);
    }

    // A set-point that is none is refused; the command stands.
    cdpr_f32_set_point broken = set_point;
    broken.orientation[0] = 0.0f;
    if (is_ok(cdpr_f32_tick(&tracker, &broken, &command))) {
        return 1;
    }

    // After a power cut: from the encoders, here good to 5 mm, and without any force.
    float measured_m[CDPR_CABLES];
    for (size_t i = 0; i < CDPR_CABLES; ++i) {
        measured_m[i] = command.cables[i].rest_length_m + (i % 2 == 0 ? 0.004f : -0.004f);
    }
    tracker = (cdpr_f32_tracker){{0}};
    if (!is_ok(cdpr_f32_start_from_lengths(&tracker, &crane, &load, &settings, &set_point, measured_m,
                                           0.005f)) ||
        !is_ok(cdpr_f32_last_command(&tracker, &command))) {
        return 1;
    }
    print_lengths(&command);
    return 0;
}
