/* A tag on a microcontroller: hand it what the sensors measure, it publishes over Zenoh with zenoh-pico. */
#ifndef ZENOH_PICO_TAG_H
#define ZENOH_PICO_TAG_H

#include <stdint.h>

typedef struct {
    const char *site;    /* "default" */
    const char *tag;     /* "cart-1" */
    const char *locator; /* of the router: "tcp/192.168.1.10:7447" */
} tag_settings;

/* Time since the start, ns. The service finds out by itself how it lies to UTC. */
int64_t tag_now_ns(void);

/* Call tag_init first. The next two may then be called from any task, but not from an interrupt: let a task read the
 * queue that the interrupt fills. They never wait for the network. */
int tag_init(void);

/* A two-way range, from the callback of the DW3000 driver. t_ns: when it was measured, by tag_now_ns. */
void tag_on_range(int64_t t_ns, uint32_t anchor, float range_m, float std_m);

/* Body frame x forward, y left, z up. acc: specific force, m/s². gyro: rad/s. mag: µT, or NULL without one. */
void tag_on_imu(int64_t t_ns, const float acc[3], const float gyro[3], const float mag[3]);

/* Samples that were left out because nobody sent them in time. */
uint32_t tag_dropped(void);

/* Connects, publishes, connects again: for ever. Give it a task of its own. */
void tag_run(const tag_settings *settings);

#endif
