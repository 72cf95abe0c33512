/* The codec of dropanchor.h as a filter, for the tests.
 *
 * encode: a frame as text -> its payload.   decode: a payload -> the frame as text.
 * check: payloads, each after its length (u32, little-endian) -> the reason of each, a line.
 * number, key: words of the command line. */
#include "dropanchor.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#define MAX_SAMPLES 64

static uint8_t payload[DROPANCHOR_MAX_PAYLOAD + 1];

static float next_float(void) {
    char text[64];
    if (scanf("%63s", text) != 1) exit(3);
    return strtof(text, NULL);
}

static int encode(void) {
    static dropanchor_imu imu[MAX_SAMPLES];
    static dropanchor_range ranges[MAX_SAMPLES];
    static dropanchor_heading headings[MAX_SAMPLES];
    static dropanchor_bearing bearings[MAX_SAMPLES];
    static dropanchor_pressure pressures[MAX_SAMPLES];
    dropanchor_frame f = {
        .imu = imu, .ranges = ranges, .headings = headings, .bearings = bearings, .pressures = pressures};
    int boot, replay;
    char kind[16];
    if (scanf("%d %d %" SCNu32 " %" SCNu32, &boot, &replay, &f.sequence, &f.boot_id) != 4) return 3;
    f.boot_clock = boot != 0;
    f.replay = replay != 0;
    int64_t t_ns;
    while (scanf("%15s %" SCNd64, kind, &t_ns) == 2) {
        uint32_t anchor = 0;
        if ((kind[0] == 'r' || kind[0] == 'b') && scanf("%" SCNu32, &anchor) != 1) return 3;
        if (kind[0] == 'i') {
            dropanchor_imu *s = &imu[f.imu_count++];
            s->t_ns = t_ns;
            for (int k = 0; k < 3; k++) s->acc[k] = next_float();
            for (int k = 0; k < 3; k++) s->gyro[k] = next_float();
            for (int k = 0; k < 3; k++) s->mag[k] = next_float();
            continue;
        }
        const float value = next_float(), std = next_float();
        if (kind[0] == 'r') ranges[f.range_count++] = (dropanchor_range){t_ns, anchor, value, std};
        if (kind[0] == 'h') headings[f.heading_count++] = (dropanchor_heading){t_ns, value, std};
        if (kind[0] == 'b') bearings[f.bearing_count++] = (dropanchor_bearing){t_ns, anchor, value, std};
        if (kind[0] == 'p') pressures[f.pressure_count++] = (dropanchor_pressure){t_ns, value, std};
    }
    const size_t size = dropanchor_write(&f, payload, sizeof payload);
    if (size == 0) return 4;
    if (dropanchor_write(&f, payload, size - 1) != 0) return 5; /* a byte too few */
    fwrite(payload, 1, size, stdout);
    return 0;
}

static int decode(void) {
    dropanchor_header h;
    const size_t size = fread(payload, 1, sizeof payload, stdin);
    const dropanchor_reason reason = dropanchor_read(payload, size, &h);
    if (reason != DROPANCHOR_OK) return 4;
    printf("%d %d %" PRIu32 " %" PRIu32 "\n", h.boot_clock, h.replay, h.sequence, h.boot_id);
    for (size_t i = 0; i < h.imu_count; i++) {
        const dropanchor_imu s = dropanchor_imu_at(payload, &h, i);
        printf("imu %" PRId64, s.t_ns);
        for (int k = 0; k < 3; k++) printf(" %a", (double)s.acc[k]);
        for (int k = 0; k < 3; k++) printf(" %a", (double)s.gyro[k]);
        for (int k = 0; k < 3; k++) printf(" %a", (double)s.mag[k]);
        printf("\n");
    }
    for (size_t i = 0; i < h.range_count; i++) {
        const dropanchor_range s = dropanchor_range_at(payload, &h, i);
        printf("range %" PRId64 " %" PRIu32 " %a %a\n", s.t_ns, s.anchor, (double)s.range_m, (double)s.std_m);
    }
    for (size_t i = 0; i < h.heading_count; i++) {
        const dropanchor_heading s = dropanchor_heading_at(payload, &h, i);
        printf("heading %" PRId64 " %a %a\n", s.t_ns, (double)s.heading_rad, (double)s.std_rad);
    }
    for (size_t i = 0; i < h.bearing_count; i++) {
        const dropanchor_bearing s = dropanchor_bearing_at(payload, &h, i);
        printf("bearing %" PRId64 " %" PRIu32 " %a %a\n", s.t_ns, s.anchor, (double)s.bearing_rad, (double)s.std_rad);
    }
    for (size_t i = 0; i < h.pressure_count; i++) {
        const dropanchor_pressure s = dropanchor_pressure_at(payload, &h, i);
        printf("pressure %" PRId64 " %a %a\n", s.t_ns, (double)s.pressure_pa, (double)s.temperature_c);
    }
    return 0;
}

/* Each payload lies in memory of its own size, so that the sanitizer sees a byte read beyond it. */
static int check(void) {
    uint8_t length[4];
    while (fread(length, 1, 4, stdin) == 4) {
        const size_t size = (size_t)dropanchor_get_(length, 4);
        uint8_t *exact = malloc(size ? size : 1);
        if (exact == NULL || fread(exact, 1, size, stdin) != size) return 3;
        dropanchor_header h;
        const dropanchor_reason reason = dropanchor_read(exact, size, &h);
        printf("%s\n", dropanchor_reason_name(reason));
        if (reason == DROPANCHOR_OK) {
            volatile float used = 0;
            for (size_t i = 0; i < h.imu_count; i++) used = dropanchor_imu_at(exact, &h, i).mag[2];
            for (size_t i = 0; i < h.range_count; i++) used = dropanchor_range_at(exact, &h, i).std_m;
            for (size_t i = 0; i < h.heading_count; i++) used = dropanchor_heading_at(exact, &h, i).std_rad;
            for (size_t i = 0; i < h.bearing_count; i++) used = dropanchor_bearing_at(exact, &h, i).std_rad;
            for (size_t i = 0; i < h.pressure_count; i++) used = dropanchor_pressure_at(exact, &h, i).temperature_c;
            (void)used;
        }
        free(exact);
    }
    return 0;
}

int main(int argc, char **argv) {
    const char *mode = argc > 1 ? argv[1] : "";
    char key[DROPANCHOR_MAX_KEY];
    if (strcmp(mode, "encode") == 0) return encode();
    if (strcmp(mode, "decode") == 0) return decode();
    if (strcmp(mode, "check") == 0) return check();
    if (strcmp(mode, "number") == 0 && argc == 3) return printf("%" PRIu32 "\n", dropanchor_anchor_number(argv[2])) < 0;
    if (strcmp(mode, "key") == 0 && argc == 4) {
        if (!dropanchor_key(key, sizeof key, argv[2], argv[3], "samples")) return 4;
        return printf("%s\n", key) < 0;
    }
    return 2;
}
