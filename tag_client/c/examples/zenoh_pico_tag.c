/* See zenoh_pico_tag.h. For ESP-IDF, Zephyr and POSIX; needs zenoh-pico with publication and liveliness. */
#include "zenoh_pico_tag.h"

#include <zenoh-pico.h>

#include "../dropanchor.h"

#if defined(ESP_PLATFORM)
#include <esp_timer.h>
#elif defined(__ZEPHYR__)
#include <zephyr/kernel.h>
#else
#include <time.h>
#endif

/* 100 ms of an IMU at 100 Hz and a radio at 20 Hz, with room for a slow turn of the network: 2 * 4.9 kB. */
enum { MAX_IMU = 64, MAX_RANGES = 64, SEND_EVERY_MS = 100, RETRY_MS = 1000 };

typedef struct {
    dropanchor_imu imu[MAX_IMU];
    dropanchor_range ranges[MAX_RANGES];
    uint16_t imu_count, range_count;
} samples;

static samples waiting, sending; /* tasks fill `waiting`; tag_run alone uses `sending` */
static uint32_t dropped;
static z_owned_mutex_t lock;

int64_t tag_now_ns(void) {
#if defined(ESP_PLATFORM)
    return esp_timer_get_time() * 1000;
#elif defined(__ZEPHYR__)
    return (int64_t)k_ticks_to_ns_floor64((uint64_t)k_uptime_ticks());
#else
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
#endif
}

int tag_init(void) { return z_mutex_init(&lock); }

void tag_on_range(int64_t t_ns, uint32_t anchor, float range_m, float std_m) {
    z_mutex_lock(z_loan_mut(lock));
    if (waiting.range_count < MAX_RANGES) {
        waiting.ranges[waiting.range_count++] = (dropanchor_range){t_ns, anchor, range_m, std_m};
    } else {
        dropped++;
    }
    z_mutex_unlock(z_loan_mut(lock));
}

void tag_on_imu(int64_t t_ns, const float acc[3], const float gyro[3], const float mag[3]) {
    static const float none[3] = {NAN, NAN, NAN};
    dropanchor_imu sample = {.t_ns = t_ns};
    memcpy(sample.acc, acc, sizeof sample.acc);
    memcpy(sample.gyro, gyro, sizeof sample.gyro);
    memcpy(sample.mag, mag != NULL ? mag : none, sizeof sample.mag);
    z_mutex_lock(z_loan_mut(lock));
    if (waiting.imu_count < MAX_IMU) {
        waiting.imu[waiting.imu_count++] = sample;
    } else {
        dropped++;
    }
    z_mutex_unlock(z_loan_mut(lock));
}

uint32_t tag_dropped(void) {
    z_mutex_lock(z_loan_mut(lock));
    const uint32_t count = dropped;
    z_mutex_unlock(z_loan_mut(lock));
    return count;
}

static void take(void) {
    z_mutex_lock(z_loan_mut(lock));
    sending = waiting;
    waiting.imu_count = waiting.range_count = 0;
    z_mutex_unlock(z_loan_mut(lock));
}

/* Puts what waited as one message. */
static z_result_t put(const z_loaned_publisher_t *publisher, uint32_t boot_id, uint32_t *sequence) {
    static uint8_t payload[DROPANCHOR_SIZE(MAX_IMU, MAX_RANGES, 0, 0)];
    take();
    const dropanchor_frame frame = {.boot_clock = true,
                                    .sequence = *sequence,
                                    .boot_id = boot_id,
                                    .imu = sending.imu,
                                    .ranges = sending.ranges,
                                    .imu_count = sending.imu_count,
                                    .range_count = sending.range_count};
    const size_t size = dropanchor_write(&frame, payload, sizeof payload);
    if (size == 0) return 0; /* nothing waited */
    ++*sequence;
    z_owned_bytes_t bytes;
    const z_result_t copied = z_bytes_copy_from_buf(&bytes, payload, size);
    return copied < 0 ? copied : z_publisher_put(publisher, z_move(bytes), NULL);
}

static z_result_t declare(const z_loaned_session_t *session, const tag_settings *settings, z_owned_publisher_t *publisher,
                          z_owned_liveliness_token_t *token) {
    static char text[DROPANCHOR_MAX_KEY];
    z_view_keyexpr_t key;
    z_publisher_options_t options;
    z_owned_encoding_t encoding;
    z_publisher_options_default(&options);
    z_result_t result = z_encoding_from_str(&encoding, DROPANCHOR_ENCODING);
    if (result < 0) return result;
    options.encoding = z_move(encoding);
    options.congestion_control = Z_CONGESTION_CONTROL_DROP;
    if (!dropanchor_key(text, sizeof text, settings->site, settings->tag, "samples")) return -1;
    result = z_view_keyexpr_from_str(&key, text);
    if (result < 0) return result;
    result = z_declare_publisher(session, publisher, z_loan(key), &options);
    if (result < 0) return result;
    if (!dropanchor_key(text, sizeof text, settings->site, settings->tag, "alive")) return -1;
    result = z_view_keyexpr_from_str(&key, text);
    return result < 0 ? result : z_liveliness_declare_token(session, token, z_loan(key), NULL);
}

static z_result_t open_session(const tag_settings *settings, z_owned_session_t *session) {
    z_owned_config_t config;
    z_config_default(&config);
    zp_config_insert(z_loan_mut(config), Z_CONFIG_MODE_KEY, "client");
    zp_config_insert(z_loan_mut(config), Z_CONFIG_CONNECT_KEY, settings->locator);
    return z_open(session, z_move(config), NULL);
}

void tag_run(const tag_settings *settings) {
    uint32_t sequence = 0, boot_id = 0;
    while (boot_id == 0) boot_id = z_random_u32(); /* 0 would say: not numbered */
    for (;;) {
        z_owned_session_t session;
        z_owned_publisher_t publisher;
        z_owned_liveliness_token_t token;
        z_internal_null(&publisher);
        z_internal_null(&token);
        if (open_session(settings, &session) == 0) {
            if (declare(z_loan(session), settings, &publisher, &token) == 0) {
                while (!z_session_is_closed(z_loan(session)) && put(z_loan(publisher), boot_id, &sequence) == 0) {
                    z_sleep_ms(SEND_EVERY_MS);
                }
            }
            z_drop(z_move(token));
            z_drop(z_move(publisher));
            z_drop(z_move(session));
        }
        z_sleep_ms(RETRY_MS);
    }
}
