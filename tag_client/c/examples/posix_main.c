/* The tag of zenoh_pico_tag.c on a computer, with made-up sensors: see the dot before there is a board.
 *
 *     posix_main tcp/127.0.0.1:7447 cart-1        anchor 0; the tag drives eights around a point 10 m north of it
 *
 * It slows down and speeds up: that is what shows which way the IMU is mounted. A circle at a constant speed does not.
 */
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "zenoh_pico_tag.h"

/* Wheels shake every IMU. One that repeats itself would count as stuck, and a quiet one as a tag that stands. */
static float shaken(double value, double by) { return (float)(value + by * (2.0 * rand() / RAND_MAX - 1.0)); }

typedef struct {
    double east, north; /* m, of the anchor */
} place;

static place place_at(double t_s) {
    const double phase = 0.17 * t_s - 0.12 * cos(0.7 * t_s);
    return (place){6.0 * sin(phase), 10.0 + 3.0 * sin(2.0 * phase)};
}

/* What an IMU measures that looks ahead on this way: by differences of places, 10 ms apart. */
static void measure(double t_s, float acc[3], float gyro[3], float mag[3]) {
    const double step_s = 0.01;
    const place before = place_at(t_s - step_s), now = place_at(t_s), after = place_at(t_s + step_s);
    const double vx = (after.east - before.east) / (2 * step_s), vy = (after.north - before.north) / (2 * step_s);
    const double ax = (after.east - 2 * now.east + before.east) / (step_s * step_s);
    const double ay = (after.north - 2 * now.north + before.north) / (step_s * step_s);
    const double speed = hypot(vx, vy), ahead = (ax * vx + ay * vy) / speed, left = (vx * ay - vy * ax) / speed;
    acc[0] = shaken(ahead, 0.8), acc[1] = shaken(left, 0.8), acc[2] = shaken(9.81, 0.8);
    gyro[0] = shaken(0.0, 0.02), gyro[1] = shaken(0.0, 0.02), gyro[2] = shaken(left / speed, 0.02);
    mag[0] = (float)(20.0 * vy / speed), mag[1] = (float)(20.0 * vx / speed), mag[2] = -44.0f;
}

/* Where a DW3000 driver would call back, and the queue of an IMU would be read. */
static void *sensors(void *unused) {
    const struct timespec pause = {.tv_nsec = 10 * 1000 * 1000};
    const int64_t began_ns = tag_now_ns();
    (void)unused;
    for (unsigned tick = 0;; tick++) {
        const int64_t now_ns = tag_now_ns();
        const double t_s = 1e-9 * (double)(now_ns - began_ns);
        const place here = place_at(t_s);
        float acc[3], gyro[3], mag[3];
        measure(t_s, acc, gyro, mag);
        tag_on_imu(now_ns, acc, gyro, mag);
        if (tick % 10 == 0) tag_on_range(now_ns, 0, (float)hypot(here.east, here.north), 0.1f);
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
