/* The tag of zenoh_pico_tag.c on a computer, with made-up sensors: see the dot before there is a board.
 *
 *     posix_main tcp/127.0.0.1:7447 cart-1        anchor 0; the tag circles 5 m around a point 10 m north of it, 1 m/s
 */
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "zenoh_pico_tag.h"

/* Wheels shake every IMU. One that repeats itself would count as stuck, and a quiet one as a tag that stands. */
static float shaken(double value, double by) { return (float)(value + by * (2.0 * rand() / RAND_MAX - 1.0)); }

/* Where a DW3000 driver would call back, and the queue of an IMU would be read. */
static void *sensors(void *unused) {
    const struct timespec pause = {.tv_nsec = 10 * 1000 * 1000};
    const int64_t began_ns = tag_now_ns();
    (void)unused;
    for (unsigned tick = 0;; tick++) {
        const int64_t now_ns = tag_now_ns();
        const double angle = 0.2 * 1e-9 * (double)(now_ns - began_ns); /* 1 m/s on a radius of 5 m */
        const float acc[3] = {shaken(0.0, 0.8), shaken(0.2, 0.8), shaken(9.81, 0.8)};
        const float gyro[3] = {shaken(0.0, 0.02), shaken(0.0, 0.02), shaken(0.2, 0.02)};
        const double heading = angle + 1.5707963;
        const float mag[3] = {(float)(20.0 * sin(heading)), (float)(20.0 * cos(heading)), -44.0f};
        tag_on_imu(now_ns, acc, gyro, mag);
        if (tick % 10 == 0) {
            tag_on_range(now_ns, 0, (float)hypot(5.0 * cos(angle), 10.0 + 5.0 * sin(angle)), 0.1f);
        }
        nanosleep(&pause, NULL);
    }
    return NULL;
}

int main(int argc, char **argv) {
    pthread_t thread;
    if (argc != 3) {
        fprintf(stderr, "usage: %s tcp/ROUTER:7447 TAG\n", argv[0]);
        return 2;
    }
    const tag_settings settings = {.site = "default", .tag = argv[2], .locator = argv[1]};
    if (tag_init() != 0 || pthread_create(&thread, NULL, sensors, NULL) != 0) return 1;
    tag_run(&settings);
}
