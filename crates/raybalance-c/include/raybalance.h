/* raybalance: rays traced over several devices, which are kept busy to the end.
 *
 * Made from the crate raybalance-c; do not change it by hand. Every function that can fail returns a status, and
 * rb_error() has the words. docs/embedding.md shows how to build against it.
 *
 * Licence: MIT or Apache-2.0, as you prefer. */

#ifndef RAYBALANCE_H
#define RAYBALANCE_H

#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

// The `primitive` of a ray that hits nothing.
#define RB_MISS 4294967295

// How a call ended. `rb_error` has the words.
typedef enum {
  // It did what it should.
  RB_OK = 0,
  // An argument is wrong: the caller's mistake. Nothing has changed.
  RB_INVALID_ARGUMENT = 1,
  // A device cannot be used, or every device failed.
  RB_DEVICE = 2,
  // `rb_cancel` ended it. Hits of finished tasks are there.
  RB_CANCELLED = 3,
  // The system has no memory for it.
  RB_OUT_OF_MEMORY = 4,
  // A defect of this library; the handle must only be freed.
  RB_DEFECT = 5,
} rb_status;

// Triangles and the tree over them.
typedef struct rb_scene rb_scene;

// A scene on devices, and what was learnt about them.
typedef struct rb_tracer rb_tracer;

// One of the meshes of a scene.
typedef struct {
  // Three numbers for each vertex.
  const float *positions;
  // Number of vertices.
  size_t vertices;
  // Three vertices of this mesh for each triangle.
  const uint32_t *indices;
  // Number of triangles.
  size_t triangles;
  // Rays whose mask has none of these bits pass it by; 0: none does.
  uint32_t mask;
} rb_mesh;

// The points `origin + t * direction` with `tmin <= t <= tmax`. The direction need not have unit length. A ray that is
// no number somewhere, has no direction or `tmin > tmax` misses.
typedef struct {
  // Where `t = 0`.
  float origin[3];
  // Smallest accepted `t`.
  float tmin;
  // Direction, of any finite length but zero.
  float direction[3];
  // Largest accepted `t`; infinity is valid.
  float tmax;
} rb_ray;

// A hit, or a miss: then `primitive` is `RB_MISS` and `t` is infinite.
typedef struct {
  // Distance in lengths of the ray's direction.
  float t;
  // Barycentric weight of the second vertex.
  float u;
  // Barycentric weight of the third vertex.
  float v;
  // Which of the scene's triangles, from 0.
  uint32_t primitive;
} rb_hit;

// Choices about a trace. All zero is the usual: the nearest hits, nothing known of the rays.
typedef struct {
  // Not 0: some hit, if there is one, instead of the nearest.
  uint32_t any_hit;
  // Not 0: rays that follow each other take similar paths, as neighbours of a picture do. It changes no hit.
  uint32_t coherent;
  // Rays per task, which is what is dealt to devices; 0: 1,024.
  uint32_t task_size;
  // Above 1: so many of the nearest hits of each ray, in order of distance. `hits` then has so many places for each
  // ray in a row, and those beyond a ray's hits are misses. CPU devices alone trace that.
  uint32_t most_hits;
  // Rays pass by meshes whose mask has none of these bits; 0: by none.
  uint32_t mask;
  // Called with each task's hits once they are there, by the thread that traces; null: not. A task comes again where
  // a device is not believed any more. It must return, and call nothing of this library but `rb_cancel`.
  void (*finished)(void *user, uint32_t first, uint32_t rays, const rb_hit *hits);
  // What `finished` is called with.
  void *user;
} rb_options;

// What finding a hit took: the same on every device.
typedef struct {
  // Box tests.
  uint32_t boxes;
  // Triangle tests.
  uint32_t triangles;
} rb_counts;

// How a trace went. Seconds, and shares without a unit.
typedef struct {
  // From before the estimation until the last hit was there.
  double makespan_s;
  // The estimation's part of it.
  double estimate_s;
  // How much longer it took than if all devices had been busy to the end; NaN where that is not known.
  double imbalance;
  // Number of tasks.
  uint32_t tasks;
} rb_run;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// What went wrong in this thread's last call: a sentence that names the argument and says what to do, in UTF-8. Empty
// if nothing did. It stays until this thread's next call.
const char *rb_error(void);

// Builds a scene of triangles. `positions` are three numbers for each of `vertices`, `indices` three vertices for each
// of `triangles`; both are copied. All cores build. A hit's `primitive` is a triangle in this order.
//
// # Safety
// `positions` and `indices` point to so many numbers, and `scene` to where the handle goes: null after a failure.
rb_status rb_scene_new(const float *positions,
                       size_t vertices,
                       const uint32_t *indices,
                       size_t triangles,
                       rb_scene **scene);

// Builds one scene of `count` meshes. A hit's `primitive` counts the triangles of one mesh after the other:
// `rb_geometry_of` tells which mesh, and which of its triangles.
//
// # Safety
// `meshes` points to so many meshes, whose pointers lead to so many numbers as each says, and `scene` to where the
// handle goes: null after a failure.
rb_status rb_scene_of_meshes(const rb_mesh *meshes,
                             size_t count,
                             rb_scene **scene);

// Which of the meshes a hit's `primitive` belongs to, and its number there.
//
// # Safety
// `scene` is a scene; `geometry` and `triangle` each point to a number to write, or are null.
rb_status rb_geometry_of(const rb_scene *scene, uint32_t primitive, uint32_t *geometry, uint32_t *triangle);

// Frees a scene; null is none. Tracers of it go on.
//
// # Safety
// `scene` comes from `rb_scene_new` and is not used any more.
void rb_scene_free(rb_scene *scene);

// Opens devices and brings a scene to them. `devices` is a list such as "cpu:2,vulkan:0@0.5" (threads; number of the
// graphics card; speed, to try things out), or "auto": a device for each core, and every graphics card. Keep a tracer:
// it learns what tests cost on each device and what rays cost in the scene.
//
// # Safety
// `scene` is a scene, `devices` ends with a zero byte, and `tracer` points to where the handle goes: null after a
// failure.
rb_status rb_tracer_new(const rb_scene *scene,
                        const char *devices,
                        rb_tracer **tracer);

// Frees a tracer; null is none.
//
// # Safety
// `tracer` comes from `rb_tracer_new` and is not used any more, by other threads either.
void rb_tracer_free(rb_tracer *tracer);

// How many devices a tracer has; 0 for null.
//
// # Safety
// `tracer` is a tracer or null.
size_t rb_tracer_devices(const rb_tracer *tracer);

// The name of a device, in the order of the list; null beyond the last. It stays as long as the tracer.
//
// # Safety
// `tracer` is a tracer or null.
const char *rb_device_name(const rb_tracer *tracer, size_t device);

// Traces rays: `hits[i]` is the hit of `rays[i]`, unless `options` ask for several of each. `options` (null: the
// usual), `counts` (null: not counted) and `run` (null: not told) may be left out. Rays are copied. One thread traces
// at a time, others wait.
//
// # Safety
// `tracer` is a tracer; `rays`, `hits` and, unless null, `counts` point to `count` values each (`hits` to `most_hits`
// times as many where that is above 1), which nobody else writes to meanwhile; `run` and `options` are null or point
// to one.
rb_status rb_trace(const rb_tracer *tracer,
                   const rb_ray *rays,
                   size_t count,
                   const rb_options *options,
                   rb_hit *hits,
                   rb_counts *counts,
                   rb_run *run);

// Ends the trace that is running, which returns `RB_CANCELLED` soon; if none is, the next one. From any thread, and
// from a signal handler.
//
// # Safety
// `tracer` is a tracer or null.
void rb_cancel(const rb_tracer *tracer);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* RAYBALANCE_H */
