/* What goes wrong at the border: every mistake is a status with words, and the tracer is as good as before. */
#include "raybalance.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static int failures = 0;

/* The status and a part of the words. */
static void expect(int line, rb_status found, rb_status wanted, const char *words) {
    if (found != wanted || strstr(rb_error(), words) == NULL) {
        fprintf(stderr, "line %d: status %d, not %d: `%s` should have `%s`\n", line, (int)found, (int)wanted,
                rb_error(), words);
        failures++;
    }
}

#define EXPECT(found, wanted, words) expect(__LINE__, (found), (wanted), (words))

static rb_tracer *cancelled;

static void cancel(void *user, uint32_t first, uint32_t rays, const rb_hit *hits) {
    (void)user, (void)first, (void)rays, (void)hits;
    rb_cancel(cancelled);
}

int main(void) {
    const float positions[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, NAN, 0, 0};
    const uint32_t indices[] = {0, 1, 2}, beyond[] = {0, 1, 4}, nan_corner[] = {0, 1, 3};
    rb_scene *scene = (rb_scene *)positions;
    EXPECT(rb_scene_new(NULL, 3, indices, 1, &scene), RB_INVALID_ARGUMENT, "positions: null");
    EXPECT(rb_scene_new(positions, 3, NULL, 1, &scene), RB_INVALID_ARGUMENT, "indices: null");
    EXPECT(rb_scene_new(positions, 3, indices, 1, NULL), RB_INVALID_ARGUMENT, "scene: null");
    EXPECT(rb_scene_new(positions, (size_t)-1, indices, 1, &scene), RB_INVALID_ARGUMENT, "positions: ");
    EXPECT(rb_scene_new(positions, 4, beyond, 1, &scene), RB_INVALID_ARGUMENT, "vertex 4");
    if (scene != NULL) {
        fprintf(stderr, "a handle after a failure\n");
        failures++;
    }
    EXPECT(rb_scene_new(positions, 4, nan_corner, 1, &scene), RB_INVALID_ARGUMENT, "NaN");
    EXPECT(rb_scene_new(positions, 3, indices, 1, &scene), RB_OK, "");

    rb_tracer *tracer;
    EXPECT(rb_tracer_new(NULL, "cpu", &tracer), RB_INVALID_ARGUMENT, "scene: null");
    EXPECT(rb_tracer_new(scene, NULL, &tracer), RB_INVALID_ARGUMENT, "devices: null");
    EXPECT(rb_tracer_new(scene, "cpu:0", &tracer), RB_INVALID_ARGUMENT, "`cpu:0`");
    EXPECT(rb_tracer_new(scene, "\xff", &tracer), RB_INVALID_ARGUMENT, "UTF-8");
    EXPECT(rb_tracer_new(scene, "cpu", NULL), RB_INVALID_ARGUMENT, "tracer: null");
    EXPECT(rb_tracer_new(scene, "cpu:1", &tracer), RB_OK, "");
    rb_scene_free(scene);
    rb_scene_free(NULL);
    if (rb_tracer_devices(tracer) != 1 || rb_tracer_devices(NULL) != 0 ||
        strstr(rb_device_name(tracer, 0), "CPU") == NULL || rb_device_name(tracer, 1) != NULL) {
        fprintf(stderr, "devices\n");
        failures++;
    }

    /* Two meshes: the far one for all rays, the near one for those with the second bit. */
    const float near_positions[] = {0, 0, 1, 1, 0, 1, 0, 1, 1};
    const rb_mesh meshes[] = {{positions, 3, indices, 1, 0}, {near_positions, 3, indices, 1, 2}};
    const rb_mesh wrong = {positions, 3, beyond, 1, 0}, absent = {NULL, 3, indices, 1, 0};
    EXPECT(rb_scene_of_meshes(NULL, 2, &scene), RB_INVALID_ARGUMENT, "meshes: null");
    EXPECT(rb_scene_of_meshes(&wrong, 1, &scene), RB_INVALID_ARGUMENT, "mesh 0: triangle 0 names vertex 4");
    EXPECT(rb_scene_of_meshes(&absent, 1, &scene), RB_INVALID_ARGUMENT, "meshes[0].positions: null");
    EXPECT(rb_scene_of_meshes(meshes, 2, &scene), RB_OK, "");
    uint32_t mesh = 9, triangle = 9;
    EXPECT(rb_geometry_of(scene, 1, &mesh, &triangle), RB_OK, "");
    EXPECT(rb_geometry_of(scene, RB_MISS, &mesh, NULL), RB_INVALID_ARGUMENT, "primitive: ");
    EXPECT(rb_geometry_of(NULL, 0, &mesh, NULL), RB_INVALID_ARGUMENT, "scene: null");
    rb_tracer *of_meshes;
    EXPECT(rb_tracer_new(scene, "cpu:1", &of_meshes), RB_OK, "");
    rb_scene_free(scene);
    const rb_ray down = {{0.2f, 0.2f, 2}, 0, {0, 0, -1}, INFINITY};
    rb_hit three[3], one;
    const rb_options all = {.most_hits = 3}, hidden = {.mask = 1}, both = {.most_hits = 2, .any_hit = 1};
    EXPECT(rb_trace(of_meshes, &down, 1, &all, three, NULL, NULL), RB_OK, "");
    EXPECT(rb_trace(of_meshes, &down, 1, &hidden, &one, NULL, NULL), RB_OK, "");
    EXPECT(rb_trace(of_meshes, &down, 1, &both, three, NULL, NULL), RB_INVALID_ARGUMENT, "any_hit");
    if (mesh != 1 || triangle != 0 || three[0].primitive != 1 || three[0].t != 1 || three[1].primitive != 0 ||
        three[1].t != 2 || three[2].primitive != RB_MISS || one.primitive != 0) {
        fprintf(stderr, "meshes, masks or several hits\n");
        failures++;
    }
    rb_tracer_free(of_meshes);

    /* So many that they are not traced in one launch. */
    enum { RAYS = 300000 };
    static rb_ray rays[RAYS];
    static rb_hit hits[RAYS];
    static rb_counts counts[RAYS];
    for (int i = 0; i < RAYS; i++) {
        rays[i] = (rb_ray){{0.2f, 0.2f, 1}, 0, {0, 0, -1}, INFINITY};
    }
    rays[7].origin[0] = NAN;
    EXPECT(rb_trace(NULL, rays, RAYS, NULL, hits, NULL, NULL), RB_INVALID_ARGUMENT, "tracer: null");
    EXPECT(rb_trace(tracer, NULL, RAYS, NULL, hits, NULL, NULL), RB_INVALID_ARGUMENT, "rays: null");
    EXPECT(rb_trace(tracer, rays, RAYS, NULL, NULL, NULL, NULL), RB_INVALID_ARGUMENT, "hits: null");
    EXPECT(rb_trace(tracer, rays, (size_t)-1, NULL, hits, NULL, NULL), RB_INVALID_ARGUMENT, "rays: ");
    EXPECT(rb_trace(tracer, (rb_ray *)((char *)rays + 1), 1, NULL, hits, NULL, NULL), RB_INVALID_ARGUMENT,
           "aligned");
    EXPECT(rb_trace(tracer, NULL, 0, NULL, NULL, NULL, NULL), RB_OK, "");

    /* Cancelled by its own first task; then before it begins; then not. */
    cancelled = tracer;
    const rb_options stopping = {.task_size = 100, .finished = cancel};
    EXPECT(rb_trace(tracer, rays, RAYS, &stopping, hits, NULL, NULL), RB_CANCELLED, "cancelled");
    rb_cancel(NULL);
    rb_cancel(tracer);
    EXPECT(rb_trace(tracer, rays, RAYS, NULL, hits, NULL, NULL), RB_CANCELLED, "cancelled");
    rb_run run;
    EXPECT(rb_trace(tracer, rays, RAYS, NULL, hits, counts, &run), RB_OK, "");
    for (int i = 0; i < RAYS; i++) {
        const int right = i == 7 ? hits[i].primitive == RB_MISS && isinf(hits[i].t)
                                 : hits[i].primitive == 0 && hits[i].t == 1 && counts[i].triangles == 1;
        if (!right) {
            fprintf(stderr, "ray %d\n", i);
            failures++;
        }
    }
    const rb_options any = {.any_hit = 1};
    EXPECT(rb_trace(tracer, rays, RAYS, &any, hits, NULL, NULL), RB_OK, "");
    rb_tracer_free(tracer);
    rb_tracer_free(NULL);
    return failures != 0;
}
