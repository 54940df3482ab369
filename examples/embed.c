/* Traces rays from C: cc embed.c -I crates/raybalance-c/include -L target/release -lraybalance
 *
 * A square of two triangles, seen from above by rays of which every other one passes beside it. */
#include "raybalance.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#define RAYS 10000

/* What a viewer would do: show the hits that are there. */
static void finished(void *user, uint32_t first, uint32_t rays, const rb_hit *hits) {
    (void)first;
    for (uint32_t i = 0; i < rays; i++) {
        *(size_t *)user += hits[i].primitive != RB_MISS;
    }
}

static void check(rb_status status) {
    if (status != RB_OK) {
        fprintf(stderr, "error %d: %s\n", (int)status, rb_error());
        exit(EXIT_FAILURE);
    }
}

int main(void) {
    const float positions[] = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
    const uint32_t indices[] = {0, 1, 2, 0, 2, 3};
    rb_scene *scene;
    check(rb_scene_new(positions, 4, indices, 2, &scene));
    rb_tracer *tracer;
    check(rb_tracer_new(scene, "cpu:1,cpu:1", &tracer));
    rb_scene_free(scene);

    static rb_ray rays[RAYS];
    static rb_hit hits[RAYS];
    for (int i = 0; i < RAYS; i++) {
        const float x = 0.5f + (float)(i % 2);
        rays[i] = (rb_ray){.origin = {x, 0.25f, 1}, .direction = {0, 0, -1}, .tmax = INFINITY};
    }
    size_t seen = 0;
    const rb_options options = {.coherent = 1, .finished = finished, .user = &seen};
    rb_run run;
    /* Keep the tracer over frames: it learns. */
    check(rb_trace(tracer, rays, RAYS, &options, hits, NULL, &run));
    printf("%zu of %d rays hit triangle %u at %g, %u tasks in %.1f ms on %zu devices\n", seen, RAYS,
           hits[0].primitive, hits[0].t, run.tasks, 1e3 * run.makespan_s, rb_tracer_devices(tracer));
    rb_tracer_free(tracer);
    return 0;
}
