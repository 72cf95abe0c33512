/* The samples of a tag on the wire, for C99: writes and reads the packed payload of schemas/README.md.
 *
 * One header, no allocation, no dependency, any byte order. Everything is `static inline`: include it where it is used.
 *
 *     dropanchor_range range = {.t_ns = now_ns(), .anchor = dropanchor_anchor_number("L0"), .range_m = 3.5f, .std_m = NAN};
 *     dropanchor_frame frame = {.boot_clock = true, .sequence = n++, .boot_id = boot_id, .ranges = &range, .range_count = 1};
 *     uint8_t payload[DROPANCHOR_SIZE(0, 1, 0, 0)];
 *     size_t size = dropanchor_write(&frame, payload, sizeof payload);
 */
#ifndef DROPANCHOR_H
#define DROPANCHOR_H

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#define DROPANCHOR_ENCODING "application/vnd.dropanchor.samples"
#define DROPANCHOR_VERSION 1u
#define DROPANCHOR_BOOT_CLOCK 1u
#define DROPANCHOR_REPLAY 2u
#define DROPANCHOR_MAX_PAYLOAD 65536u
#define DROPANCHOR_MAX_ID 64u
/* Enough for any key: two ids, each character of which may take four bytes of three characters. */
#define DROPANCHOR_MAX_KEY (40u + 2u * 12u * DROPANCHOR_MAX_ID)

#define DROPANCHOR_HEADER_SIZE 32u
#define DROPANCHOR_IMU_SIZE 40u
#define DROPANCHOR_RANGE_SIZE 16u
#define DROPANCHOR_HEADING_SIZE 12u
#define DROPANCHOR_BEARING_SIZE 16u
#define DROPANCHOR_PRESSURE_SIZE 12u
/* Bytes of a payload with so many samples of each kind; add DROPANCHOR_PRESSURE_SIZE for every pressure. */
#define DROPANCHOR_SIZE(imu, ranges, headings, bearings)                                                    \
    ((size_t)DROPANCHOR_HEADER_SIZE + (size_t)DROPANCHOR_IMU_SIZE * (imu) +                                 \
     (size_t)DROPANCHOR_RANGE_SIZE * (ranges) + (size_t)DROPANCHOR_HEADING_SIZE * (headings) +              \
     (size_t)DROPANCHOR_BEARING_SIZE * (bearings))

/* Body frame x forward, y left, z up. Specific force m/s², rate rad/s, magnetic field µT (all NAN: none). */
typedef struct {
    int64_t t_ns;
    float acc[3], gyro[3], mag[3];
} dropanchor_imu;

/* Slant range, m. A standard deviation of NAN is unknown, here and below. */
typedef struct {
    int64_t t_ns;
    uint32_t anchor;
    float range_m, std_m;
} dropanchor_range;

/* Heading of the platform, counter-clockwise from east, rad. */
typedef struct {
    int64_t t_ns;
    float heading_rad, std_rad;
} dropanchor_heading;

/* Bearing of the tag as the anchor sees it, counter-clockwise from east, rad. */
typedef struct {
    int64_t t_ns;
    uint32_t anchor;
    float bearing_rad, std_rad;
} dropanchor_bearing;

/* Pressure of the air, Pa and not hPa. Its temperature, degrees Celsius; NAN is unknown. */
typedef struct {
    int64_t t_ns;
    float pressure_pa, temperature_c;
} dropanchor_pressure;

/* The samples of one message. Times are UTC, or since the start of the tag with boot_clock. replay: of a recording, played
 * now. */
typedef struct {
    bool boot_clock, replay;
    uint32_t sequence, boot_id;
    const dropanchor_imu *imu;
    const dropanchor_range *ranges;
    const dropanchor_heading *headings;
    const dropanchor_bearing *bearings;
    const dropanchor_pressure *pressures;
    uint16_t imu_count, range_count, heading_count, bearing_count, pressure_count;
} dropanchor_frame;

/* What a payload holds. */
typedef struct {
    bool boot_clock, replay;
    uint32_t sequence, boot_id;
    int64_t t0_ns;
    uint16_t imu_count, range_count, heading_count, bearing_count, pressure_count;
} dropanchor_header;

typedef enum {
    DROPANCHOR_OK,
    DROPANCHOR_PAYLOAD_EMPTY,
    DROPANCHOR_PAYLOAD_TOO_LARGE,
    DROPANCHOR_VERSION_UNKNOWN,
    DROPANCHOR_HEADER_TRUNCATED,
    DROPANCHOR_FLAGS_UNKNOWN,
    DROPANCHOR_RESERVED_NOT_ZERO,
    DROPANCHOR_LENGTH_MISMATCH,
    DROPANCHOR_NO_SAMPLES,
    DROPANCHOR_TIME_OUT_OF_RANGE
} dropanchor_reason;

static inline const char *dropanchor_reason_name(dropanchor_reason reason) {
    static const char *const names[] = {
        "ok",           "payload_empty",     "payload_too_large", "version_unknown", "header_truncated", "flags_unknown",
        "reserved_not_zero", "length_mismatch", "no_samples",     "time_out_of_range"};
    return names[reason];
}

/* Private: numbers to bytes and back. */

static inline void dropanchor_put_(uint8_t **at, uint64_t value, unsigned bytes) {
    for (unsigned i = 0; i < bytes; i++) *(*at)++ = (uint8_t)(value >> (8 * i) & 0xFFu);
}

static inline uint64_t dropanchor_get_(const uint8_t *at, unsigned bytes) {
    uint64_t value = 0;
    for (unsigned i = bytes; i-- > 0;) value = value << 8 | at[i];
    return value;
}

static inline void dropanchor_put_float_(uint8_t **at, float value) {
    uint32_t bits = 0x7FC00000u; /* every NaN is written alike */
    if (!isnan(value)) memcpy(&bits, &value, sizeof bits);
    dropanchor_put_(at, bits, 4);
}

static inline float dropanchor_get_float_(const uint8_t *at) {
    uint32_t bits = (uint32_t)dropanchor_get_(at, 4);
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static inline bool dropanchor_include_(int64_t t_ns, int64_t *first_ns, int64_t *last_ns) {
    if (t_ns < *first_ns) *first_ns = t_ns;
    if (t_ns > *last_ns) *last_ns = t_ns;
    return t_ns >= 0 && t_ns < INT64_C(1) << 62;
}

/* Finds the first and the last time; false when one is out of range. */
static inline bool dropanchor_span_(const dropanchor_frame *f, int64_t *first_ns, int64_t *last_ns) {
    bool good = true;
    *first_ns = INT64_MAX;
    *last_ns = 0;
    for (size_t i = 0; i < f->imu_count; i++) good &= dropanchor_include_(f->imu[i].t_ns, first_ns, last_ns);
    for (size_t i = 0; i < f->range_count; i++) good &= dropanchor_include_(f->ranges[i].t_ns, first_ns, last_ns);
    for (size_t i = 0; i < f->heading_count; i++) good &= dropanchor_include_(f->headings[i].t_ns, first_ns, last_ns);
    for (size_t i = 0; i < f->bearing_count; i++) good &= dropanchor_include_(f->bearings[i].t_ns, first_ns, last_ns);
    for (size_t i = 0; i < f->pressure_count; i++) good &= dropanchor_include_(f->pressures[i].t_ns, first_ns, last_ns);
    return good;
}

static inline int64_t dropanchor_dt_us_(int64_t t_ns, int64_t t0_ns) { return (t_ns - t0_ns + 500) / 1000; }

static inline void dropanchor_put_time_(uint8_t **at, int64_t t_ns, int64_t t0_ns) {
    dropanchor_put_(at, (uint64_t)dropanchor_dt_us_(t_ns, t0_ns), 4);
}

static inline void dropanchor_put_header_(uint8_t **at, const dropanchor_frame *f, int64_t t0_ns) {
    dropanchor_put_(at, DROPANCHOR_VERSION, 1);
    dropanchor_put_(at, (f->boot_clock ? DROPANCHOR_BOOT_CLOCK : 0u) | (f->replay ? DROPANCHOR_REPLAY : 0u), 1);
    dropanchor_put_(at, f->imu_count, 2);
    dropanchor_put_(at, f->range_count, 2);
    dropanchor_put_(at, f->heading_count, 2);
    dropanchor_put_(at, f->sequence, 4);
    dropanchor_put_(at, f->boot_id, 4);
    dropanchor_put_(at, (uint64_t)t0_ns, 8);
    dropanchor_put_(at, f->bearing_count, 2);
    dropanchor_put_(at, f->pressure_count, 2);
    dropanchor_put_(at, 0, 4);
}

static inline void dropanchor_put_imu_(uint8_t **at, const dropanchor_imu *sample, int64_t t0_ns) {
    dropanchor_put_time_(at, sample->t_ns, t0_ns);
    for (size_t i = 0; i < 3; i++) dropanchor_put_float_(at, sample->acc[i]);
    for (size_t i = 0; i < 3; i++) dropanchor_put_float_(at, sample->gyro[i]);
    for (size_t i = 0; i < 3; i++) dropanchor_put_float_(at, sample->mag[i]);
}

/* Writes the payload of a frame and returns its size. Returns 0 and writes nothing when `out` is too small, the frame has
 * no samples, a time is out of range, the samples span more than 4,294 s, or the payload would exceed 65,536 bytes. */
static inline size_t dropanchor_write(const dropanchor_frame *f, uint8_t *out, size_t capacity) {
    const size_t size = DROPANCHOR_SIZE(f->imu_count, f->range_count, f->heading_count, f->bearing_count) +
                        (size_t)DROPANCHOR_PRESSURE_SIZE * f->pressure_count;
    int64_t t0_ns, last_ns;
    if (size == DROPANCHOR_HEADER_SIZE || size > capacity || size > DROPANCHOR_MAX_PAYLOAD) return 0;
    if (!dropanchor_span_(f, &t0_ns, &last_ns) || dropanchor_dt_us_(last_ns, t0_ns) > (int64_t)UINT32_MAX) return 0;
    uint8_t *at = out;
    dropanchor_put_header_(&at, f, t0_ns);
    for (size_t i = 0; i < f->imu_count; i++) dropanchor_put_imu_(&at, &f->imu[i], t0_ns);
    for (size_t i = 0; i < f->range_count; i++) {
        dropanchor_put_time_(&at, f->ranges[i].t_ns, t0_ns);
        dropanchor_put_(&at, f->ranges[i].anchor, 4);
        dropanchor_put_float_(&at, f->ranges[i].range_m);
        dropanchor_put_float_(&at, f->ranges[i].std_m);
    }
    for (size_t i = 0; i < f->heading_count; i++) {
        dropanchor_put_time_(&at, f->headings[i].t_ns, t0_ns);
        dropanchor_put_float_(&at, f->headings[i].heading_rad);
        dropanchor_put_float_(&at, f->headings[i].std_rad);
    }
    for (size_t i = 0; i < f->bearing_count; i++) {
        dropanchor_put_time_(&at, f->bearings[i].t_ns, t0_ns);
        dropanchor_put_(&at, f->bearings[i].anchor, 4);
        dropanchor_put_float_(&at, f->bearings[i].bearing_rad);
        dropanchor_put_float_(&at, f->bearings[i].std_rad);
    }
    for (size_t i = 0; i < f->pressure_count; i++) {
        dropanchor_put_time_(&at, f->pressures[i].t_ns, t0_ns);
        dropanchor_put_float_(&at, f->pressures[i].pressure_pa);
        dropanchor_put_float_(&at, f->pressures[i].temperature_c);
    }
    return size;
}

static inline bool dropanchor_is_zero_(const uint8_t *at, size_t bytes) {
    for (size_t i = 0; i < bytes; i++) {
        if (at[i] != 0) return false;
    }
    return true;
}

/* Reads what a payload holds, or says why it is refused. After DROPANCHOR_OK the samples may be read. */
static inline dropanchor_reason dropanchor_read(const uint8_t *payload, size_t size, dropanchor_header *header) {
    if (size == 0) return DROPANCHOR_PAYLOAD_EMPTY;
    if (size > DROPANCHOR_MAX_PAYLOAD) return DROPANCHOR_PAYLOAD_TOO_LARGE;
    if (payload[0] != DROPANCHOR_VERSION) return DROPANCHOR_VERSION_UNKNOWN;
    if (size < DROPANCHOR_HEADER_SIZE) return DROPANCHOR_HEADER_TRUNCATED;
    header->boot_clock = (payload[1] & DROPANCHOR_BOOT_CLOCK) != 0;
    header->replay = (payload[1] & DROPANCHOR_REPLAY) != 0;
    header->imu_count = (uint16_t)dropanchor_get_(payload + 2, 2);
    header->range_count = (uint16_t)dropanchor_get_(payload + 4, 2);
    header->heading_count = (uint16_t)dropanchor_get_(payload + 6, 2);
    header->sequence = (uint32_t)dropanchor_get_(payload + 8, 4);
    header->boot_id = (uint32_t)dropanchor_get_(payload + 12, 4);
    const uint64_t t0_ns = dropanchor_get_(payload + 16, 8);
    header->t0_ns = (int64_t)(t0_ns & (uint64_t)INT64_MAX);
    header->bearing_count = (uint16_t)dropanchor_get_(payload + 24, 2);
    header->pressure_count = (uint16_t)dropanchor_get_(payload + 26, 2);
    if ((payload[1] & ~(DROPANCHOR_BOOT_CLOCK | DROPANCHOR_REPLAY)) != 0) return DROPANCHOR_FLAGS_UNKNOWN;
    if (!dropanchor_is_zero_(payload + 28, 4)) return DROPANCHOR_RESERVED_NOT_ZERO;
    const dropanchor_header *h = header;
    if (size != DROPANCHOR_SIZE(h->imu_count, h->range_count, h->heading_count, h->bearing_count) +
                    (size_t)DROPANCHOR_PRESSURE_SIZE * h->pressure_count)
        return DROPANCHOR_LENGTH_MISMATCH;
    if (size == DROPANCHOR_HEADER_SIZE) return DROPANCHOR_NO_SAMPLES;
    return t0_ns < UINT64_C(1) << 62 ? DROPANCHOR_OK : DROPANCHOR_TIME_OUT_OF_RANGE;
}

static inline int64_t dropanchor_time_(const uint8_t *at, const dropanchor_header *h) {
    return h->t0_ns + 1000 * (int64_t)dropanchor_get_(at, 4);
}

/* Sample `i` of each kind, for i below the count in the header of a payload that was read with DROPANCHOR_OK. */

static inline dropanchor_imu dropanchor_imu_at(const uint8_t *payload, const dropanchor_header *h, size_t i) {
    const uint8_t *at = payload + DROPANCHOR_SIZE(i, 0, 0, 0);
    dropanchor_imu sample = {.t_ns = dropanchor_time_(at, h)};
    for (size_t k = 0; k < 3; k++) {
        sample.acc[k] = dropanchor_get_float_(at + 4 + 4 * k);
        sample.gyro[k] = dropanchor_get_float_(at + 16 + 4 * k);
        sample.mag[k] = dropanchor_get_float_(at + 28 + 4 * k);
    }
    return sample;
}

static inline dropanchor_range dropanchor_range_at(const uint8_t *payload, const dropanchor_header *h, size_t i) {
    const uint8_t *at = payload + DROPANCHOR_SIZE(h->imu_count, i, 0, 0);
    return (dropanchor_range){.t_ns = dropanchor_time_(at, h),
                              .anchor = (uint32_t)dropanchor_get_(at + 4, 4),
                              .range_m = dropanchor_get_float_(at + 8),
                              .std_m = dropanchor_get_float_(at + 12)};
}

static inline dropanchor_heading dropanchor_heading_at(const uint8_t *payload, const dropanchor_header *h, size_t i) {
    const uint8_t *at = payload + DROPANCHOR_SIZE(h->imu_count, h->range_count, i, 0);
    return (dropanchor_heading){.t_ns = dropanchor_time_(at, h),
                                .heading_rad = dropanchor_get_float_(at + 4),
                                .std_rad = dropanchor_get_float_(at + 8)};
}

static inline dropanchor_bearing dropanchor_bearing_at(const uint8_t *payload, const dropanchor_header *h, size_t i) {
    const uint8_t *at = payload + DROPANCHOR_SIZE(h->imu_count, h->range_count, h->heading_count, i);
    return (dropanchor_bearing){.t_ns = dropanchor_time_(at, h),
                                .anchor = (uint32_t)dropanchor_get_(at + 4, 4),
                                .bearing_rad = dropanchor_get_float_(at + 8),
                                .std_rad = dropanchor_get_float_(at + 12)};
}

static inline dropanchor_pressure dropanchor_pressure_at(const uint8_t *payload, const dropanchor_header *h, size_t i) {
    const size_t others = DROPANCHOR_SIZE(h->imu_count, h->range_count, h->heading_count, h->bearing_count);
    const uint8_t *at = payload + others + DROPANCHOR_PRESSURE_SIZE * i;
    return (dropanchor_pressure){.t_ns = dropanchor_time_(at, h),
                                 .pressure_pa = dropanchor_get_float_(at + 4),
                                 .temperature_c = dropanchor_get_float_(at + 8)};
}

/* The number that names an anchor: the id itself where it is a decimal below 2^32 in its shortest form, else the CRC-32
 * of its UTF-8. */
static inline uint32_t dropanchor_anchor_number(const char *id) {
    uint64_t number = 0;
    uint32_t crc = UINT32_MAX;
    bool decimal = id[0] != '\0' && (id[0] != '0' || id[1] == '\0');
    for (size_t i = 0; id[i] != '\0'; i++) {
        const uint8_t byte = (uint8_t)id[i];
        decimal = decimal && byte >= '0' && byte <= '9' && number <= UINT32_MAX;
        if (decimal) number = 10 * number + (uint64_t)(byte - '0');
        crc ^= byte;
        for (int bit = 0; bit < 8; bit++) crc = crc >> 1 ^ (0xEDB88320u & (0u - (crc & 1u)));
    }
    return decimal && number <= UINT32_MAX ? (uint32_t)number : ~crc;
}

static inline bool dropanchor_stands_for_itself_(uint8_t c) {
    return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '.' || c == '_' || c == '-';
}

/* Appends an id as one chunk of a key; false when the id is empty, too long, `.`, `..` or not printable, or there is no
 * room. */
static inline bool dropanchor_append_id_(char **at, const char *end, const char *id) {
    static const char digits[] = "0123456789ABCDEF";
    size_t characters = 0;
    if (strcmp(id, ".") == 0 || strcmp(id, "..") == 0) return false;
    for (; *id != '\0'; id++) {
        const uint8_t byte = (uint8_t)*id;
        characters += (byte & 0xC0u) != 0x80u;
        if (byte < 0x20 || byte == 0x7F || end - *at < 4) return false;
        if (dropanchor_stands_for_itself_(byte)) {
            *(*at)++ = (char)byte;
        } else {
            *(*at)++ = '%';
            *(*at)++ = digits[byte >> 4];
            *(*at)++ = digits[byte & 0xF];
        }
    }
    return characters >= 1 && characters <= DROPANCHOR_MAX_ID;
}

static inline bool dropanchor_append_(char **at, const char *end, const char *text) {
    const size_t length = strlen(text);
    if ((size_t)(end - *at) <= length) return false;
    memcpy(*at, text, length + 1);
    *at += length;
    return true;
}

/* Writes the key of a tag: leaf "samples", "alive" or "pose". Ids are UTF-8. Returns false, and the text is not a key, when
 * an id is not allowed or there is no room (DROPANCHOR_MAX_KEY is always enough). */
static inline bool dropanchor_key(char *out, size_t capacity, const char *site, const char *tag, const char *leaf) {
    char *at = out;
    const char *end = out + capacity;
    return dropanchor_append_(&at, end, "dropanchor/@v1/") && dropanchor_append_id_(&at, end, site) &&
           dropanchor_append_(&at, end, "/tag/") && dropanchor_append_id_(&at, end, tag) &&
           dropanchor_append_(&at, end, "/") && dropanchor_append_(&at, end, leaf);
}

#endif
