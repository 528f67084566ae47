// antumbra.hpp: the C++17 layer over antumbra.h.
//
// Handles are objects that own what they stand for: they can be moved, not copied, and free themselves. Arrays are spans, also of
// your own structures. Calls that fail throw antumbra::Error. Filters, visitors, progress and user geometry are lambdas or
// objects of yours. antumbra.h says what functions do; this file says what is different here.
//
//     antumbra::Scene scene;
//     scene.add_triangles(positions, indices);              // std::vector<float>, or of your own structures
//     antumbra::Bvh bvh(scene);
//     std::vector<std::uint8_t> dark = bvh.batch(rays).mask(1).occluded();
//
// Exceptions in filters, visitors and progress end in the call that was passed the lambda: it throws them again when it has
// finished its other rays. Functions of user geometry and opacities must not throw: the program ends if they do.
#ifndef ANTUMBRA_HPP
#define ANTUMBRA_HPP

#include "antumbra.h"

#include <array>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace antumbra {

using Ray = antumbra_ray;
using Hit = antumbra_hit;
using PrimId = antumbra_prim_id;
using Surface = antumbra_surface;
using Box = antumbra_box;
using Instance = antumbra_instance;
using ClosestPoint = antumbra_closest_point;
using UserHit = antumbra_user_hit;
using Candidate = antumbra_candidate;
using Report = antumbra_report;

inline constexpr std::uint32_t invalid_id = ANTUMBRA_INVALID_ID;
inline constexpr std::size_t same_for_all = ANTUMBRA_SAME_FOR_ALL;

// A call that failed. what() is the text of antumbra_last_error().
class Error : public std::runtime_error {
public:
    Error(antumbra_status status, const char *text) : std::runtime_error(text), status_(status) {}
    // ANTUMBRA_INVALID_ARGUMENT and others.
    antumbra_status status() const noexcept { return status_; }

private:
    antumbra_status status_;
};

// Throws an Error unless a call succeeded.
inline void check(antumbra_status status) {
    if (status != ANTUMBRA_OK) {
        throw Error(status, antumbra_last_error());
    }
}

// Items in memory of somebody else: an address and a number. Made of containers with data() and size(), and of arrays.
template <class T> class span {
public:
    constexpr span() noexcept = default;
    constexpr span(T *data, std::size_t size) noexcept : data_(data), size_(size) {}
    template <std::size_t N> constexpr span(T (&items)[N]) noexcept : data_(items), size_(N) {}
    template <class C, class = std::enable_if_t<std::is_convertible_v<decltype(std::declval<C &>().data()), T *>>>
    constexpr span(C &&items) noexcept : data_(items.data()), size_(items.size()) {}

    constexpr T *data() const noexcept { return data_; }
    constexpr std::size_t size() const noexcept { return size_; }
    constexpr bool empty() const noexcept { return size_ == 0; }
    constexpr T *begin() const noexcept { return data_; }
    constexpr T *end() const noexcept { return data_ + size_; }
    constexpr T &operator[](std::size_t index) const noexcept { return data_[index]; }

private:
    T *data_ = nullptr;
    std::size_t size_ = 0;
};

// Items of N numbers each, with a stride in bytes. Made of containers of numbers, N for each item, and of containers of
// structures that begin with the N numbers.
template <class T, std::size_t N> class tuples {
public:
    constexpr tuples() noexcept = default;
    // `stride` is in bytes; 0 for packed items.
    constexpr tuples(const T *data, std::size_t size, std::size_t stride = 0) noexcept
        : data_(data), size_(size), stride_(stride) {}
    template <std::size_t M> constexpr tuples(const T (&numbers)[M]) noexcept : data_(numbers), size_(M / N) {
        static_assert(M % N == 0, "the numbers of an array are a multiple of those of an item");
    }
    template <class C, class V = std::remove_cv_t<std::remove_pointer_t<decltype(std::declval<const C &>().data())>>>
    tuples(const C &items) {
        if constexpr (std::is_same_v<V, T>) {
            if (items.size() % N != 0) {
                throw Error(ANTUMBRA_INVALID_ARGUMENT, "the numbers of an array are no multiple of those of an item");
            }
            data_ = items.data();
            size_ = items.size() / N;
        } else {
            static_assert(std::is_standard_layout_v<V> && sizeof(V) >= N * sizeof(T),
                          "items are numbers, or structures that begin with these numbers");
            data_ = reinterpret_cast<const T *>(items.data());
            size_ = items.size();
            stride_ = sizeof(V);
        }
    }

    constexpr const T *data() const noexcept { return data_; }
    constexpr std::size_t size() const noexcept { return size_; }
    constexpr std::size_t stride() const noexcept { return stride_; }

private:
    const T *data_ = nullptr;
    std::size_t size_ = 0;
    std::size_t stride_ = 0;
};

// Points, directions or normals.
using vectors = tuples<float, 3>;
using vectors_f64 = tuples<double, 3>;

inline bool is_hit(const Hit &hit) noexcept { return antumbra_is_hit(&hit); }
inline bool is_hit(const Surface &surface) noexcept { return antumbra_is_hit(&surface.hit); }
inline PrimId prim_of(const Hit &hit) noexcept { return antumbra_prim_of(&hit); }

// A ray over the interval (0, infinity).
inline Ray ray(const std::array<float, 3> &org, const std::array<float, 3> &dir) noexcept {
    return antumbra_ray_from(org.data(), dir.data());
}
// The open segment between two points.
inline Ray between(const std::array<float, 3> &from, const std::array<float, 3> &to) noexcept {
    return antumbra_ray_between(from.data(), to.data());
}
// Places an object, by the rows of an affine 3x4 matrix.
inline Instance instance(std::uint32_t object, const std::array<float, 12> &transform,
                         std::uint32_t mask = UINT32_MAX) noexcept {
    Instance placed{object, mask, {}};
    for (std::size_t index = 0; index < transform.size(); ++index) {
        placed.transform[index] = transform[index];
    }
    return placed;
}

namespace detail {

// Frees a handle.
template <class H, void (*Free)(H *)> struct Freed {
    void operator()(H *handle) const noexcept { Free(handle); }
};
template <class H, void (*Free)(H *)> using Owned = std::unique_ptr<H, Freed<H, Free>>;

// Keeps the first exception of callbacks until the call has returned.
class Caught {
public:
    // Runs a callback; after an exception nothing runs any more.
    template <class R, class F> R run(R otherwise, F &&callback) noexcept {
        if (any()) {
            return otherwise;
        }
        try {
            return callback();
        } catch (...) {
            std::lock_guard<std::mutex> guard(mutex_);
            if (!exception_) {
                exception_ = std::current_exception();
                any_.store(true, std::memory_order_release);
            }
            return otherwise;
        }
    }
    bool any() const noexcept { return any_.load(std::memory_order_acquire); }
    void rethrow() {
        if (exception_) {
            std::rethrow_exception(exception_);
        }
    }

private:
    std::atomic<bool> any_{false};
    std::mutex mutex_;
    std::exception_ptr exception_;
};

template <class T, class = void> struct has_occluded : std::false_type {};
template <class T>
struct has_occluded<T, std::void_t<decltype(std::declval<const T &>().occluded(0u, std::declval<const Ray &>()))>>
    : std::true_type {};
template <class T, class = void> struct has_closest : std::false_type {};
template <class T>
struct has_closest<T, std::void_t<decltype(std::declval<const T &>().closest_point(
                          0u, std::declval<const std::array<double, 3> &>(), std::declval<const std::array<double, 12> &>()))>>
    : std::true_type {};
template <class T, class = void> struct has_normal : std::false_type {};
template <class T>
struct has_normal<T, std::void_t<decltype(std::declval<const T &>().normal(0u, std::declval<const Ray &>(),
                                                                           std::declval<const UserHit &>()))>>
    : std::true_type {};

// Functions of C that call those of an object of class T, which a shared pointer on the heap keeps.
template <class T> struct Calls {
    using Pointer = std::shared_ptr<const T>;
    static const T &object(void *data) noexcept { return **static_cast<Pointer *>(data); }

    static void bounds(void *data, std::uint32_t prim_id, Box *bounds) noexcept { *bounds = object(data).bounds(prim_id); }
    static std::int32_t intersect(void *data, std::uint32_t prim_id, const Ray *ray, UserHit *hit) noexcept {
        std::optional<UserHit> found = object(data).intersect(prim_id, *ray);
        if (found) {
            *hit = *found;
        }
        return found ? 1 : 0;
    }
    static std::int32_t occluded(void *data, std::uint32_t prim_id, const Ray *ray) noexcept {
        return object(data).occluded(prim_id, *ray) ? 1 : 0;
    }
    static std::int32_t closest_point(void *data, std::uint32_t prim_id, const double *point, const double *world_from_object,
                                      double *closest) noexcept {
        std::array<double, 3> from{point[0], point[1], point[2]};
        std::array<double, 12> rows{};
        for (std::size_t index = 0; index < rows.size(); ++index) {
            rows[index] = world_from_object[index];
        }
        std::optional<std::array<double, 3>> found = object(data).closest_point(prim_id, from, rows);
        for (std::size_t axis = 0; found && axis < 3; ++axis) {
            closest[axis] = (*found)[axis];
        }
        return found ? 1 : 0;
    }
    static std::int32_t normal(void *data, std::uint32_t prim_id, const Ray *ray, const UserHit *hit, float *normal) noexcept {
        std::optional<std::array<float, 3>> found = object(data).normal(prim_id, *ray, *hit);
        for (std::size_t axis = 0; found && axis < 3; ++axis) {
            normal[axis] = (*found)[axis];
        }
        return found ? 1 : 0;
    }
    static float opacity(void *data, const Candidate *candidate) noexcept {
        return static_cast<float>(object(data)(*candidate));
    }
    static void release(void *data) { delete static_cast<Pointer *>(data); }

    static antumbra_user_geometry user_geometry(Pointer *data) {
        antumbra_user_geometry functions = antumbra_user_geometry_init();
        functions.data = data;
        functions.bounds = bounds;
        functions.intersect = intersect;
        if constexpr (has_occluded<T>::value) {
            functions.occluded = occluded;
        }
        if constexpr (has_closest<T>::value) {
            functions.closest_point = closest_point;
        }
        if constexpr (has_normal<T>::value) {
            functions.normal = normal;
        }
        functions.release = release;
        return functions;
    }
    static antumbra_opacity opacity_of(Pointer *data) {
        antumbra_opacity function = antumbra_opacity_init();
        function.data = data;
        function.opacity = opacity;
        function.release = release;
        return function;
    }
};

} // namespace detail

// User geometry of two lambdas: `bounds(prim_id)` returns a Box, `intersect(prim_id, ray)` an std::optional<UserHit>.
template <class B, class I> class UserFunctions {
public:
    UserFunctions(B bounds, I intersect) : bounds_(std::move(bounds)), intersect_(std::move(intersect)) {}
    Box bounds(std::uint32_t prim_id) const { return bounds_(prim_id); }
    std::optional<UserHit> intersect(std::uint32_t prim_id, const Ray &ray) const { return intersect_(prim_id, ray); }

private:
    B bounds_;
    I intersect_;
};
template <class B, class I> std::shared_ptr<const UserFunctions<B, I>> user(B bounds, I intersect) {
    return std::make_shared<const UserFunctions<B, I>>(std::move(bounds), std::move(intersect));
}

// A pool of threads: see 3 in antumbra.h.
class Threads {
public:
    // 0 for one thread per core.
    explicit Threads(std::size_t count = 0) {
        antumbra_threads *handle = nullptr;
        check(antumbra_threads_new(count, &handle));
        handle_.reset(handle);
    }
    std::size_t count() const {
        std::size_t count = 0;
        check(antumbra_threads_count(get(), &count));
        return count;
    }
    const antumbra_threads *get() const noexcept { return handle_.get(); }

private:
    detail::Owned<antumbra_threads, antumbra_threads_free> handle_;
};

// A list of geometries: see 4 in antumbra.h.
class Scene {
public:
    Scene() {
        antumbra_scene *handle = nullptr;
        check(antumbra_scene_new(&handle));
        handle_.reset(handle);
    }

    // Each function that adds a geometry returns its geom_id. Without indices, every three points are a triangle.
    std::uint32_t add_triangles(vectors positions, tuples<std::uint32_t, 3> indices) {
        std::uint32_t id = 0;
        check(antumbra_scene_add_triangles(get(), positions.data(), positions.size(), positions.stride(), some(indices),
                                           indices.size(), indices.stride(), &id));
        return id;
    }
    std::uint32_t add_triangles(vectors positions) {
        std::uint32_t id = 0;
        check(antumbra_scene_add_triangles(get(), positions.data(), positions.size(), positions.stride(), nullptr,
                                           positions.size() / 3, 0, &id));
        return id;
    }
    std::uint32_t add_triangles_f64(vectors_f64 positions, tuples<std::uint32_t, 3> indices) {
        std::uint32_t id = 0;
        check(antumbra_scene_add_triangles_f64(get(), positions.data(), positions.size(), positions.stride(), some(indices),
                                               indices.size(), indices.stride(), &id));
        return id;
    }
    std::uint32_t add_quads(vectors positions, tuples<std::uint32_t, 4> indices) {
        std::uint32_t id = 0;
        check(antumbra_scene_add_quads(get(), positions.data(), positions.size(), positions.stride(), some(indices),
                                       indices.size(), indices.stride(), &id));
        return id;
    }
    std::uint32_t add_quads_f64(vectors_f64 positions, tuples<std::uint32_t, 4> indices) {
        std::uint32_t id = 0;
        check(antumbra_scene_add_quads_f64(get(), positions.data(), positions.size(), positions.stride(), some(indices),
                                           indices.size(), indices.stride(), &id));
        return id;
    }
    // Four numbers each: centre and radius.
    std::uint32_t add_spheres(tuples<float, 4> spheres) {
        std::uint32_t id = 0;
        std::size_t stride = spheres.stride() == 0 ? 4 * sizeof(float) : spheres.stride();
        const float *first = spheres.data();
        check(antumbra_scene_add_spheres(get(), first, stride, first == nullptr ? nullptr : first + 3, stride, spheres.size(),
                                         &id));
        return id;
    }
    // Seven numbers each: centre, normal and radius.
    std::uint32_t add_disks(tuples<float, 7> disks) {
        std::uint32_t id = 0;
        std::size_t stride = disks.stride() == 0 ? 7 * sizeof(float) : disks.stride();
        const float *first = disks.data();
        check(antumbra_scene_add_disks(get(), first, stride, first == nullptr ? nullptr : first + 3, stride,
                                       first == nullptr ? nullptr : first + 6, stride, disks.size(), &id));
        return id;
    }
    // Four numbers for each point: place and radius. Segments are given by their first points.
    std::uint32_t add_curves(tuples<float, 4> points, tuples<std::uint32_t, 1> segments) {
        std::uint32_t id = 0;
        check(antumbra_scene_add_curves(get(), points.data(), points.size(), points.stride(), some(segments), segments.size(),
                                        segments.stride(), &id));
        return id;
    }
    // One curve through all points.
    std::uint32_t add_curves(tuples<float, 4> points) {
        std::uint32_t id = 0;
        std::size_t count = points.size() == 0 ? 0 : points.size() - 1;
        check(antumbra_scene_add_curves(get(), points.data(), points.size(), points.stride(), nullptr, count, 0, &id));
        return id;
    }
    // User geometry of an object with the functions
    //     Box bounds(std::uint32_t prim_id) const;
    //     std::optional<UserHit> intersect(std::uint32_t prim_id, const Ray &ray) const;
    // and, if it has them,
    //     bool occluded(std::uint32_t prim_id, const Ray &ray) const;
    //     std::optional<std::array<double, 3>> closest_point(std::uint32_t prim_id, const std::array<double, 3> &point,
    //                                                        const std::array<double, 12> &world_from_object) const;
    //     std::optional<std::array<float, 3>> normal(std::uint32_t prim_id, const Ray &ray, const UserHit &hit) const;
    // Scene and trees share the object. For two lambdas see antumbra::user().
    template <class T> std::uint32_t add_user(std::uint32_t count, std::shared_ptr<T> object) {
        using Calls = detail::Calls<std::remove_const_t<T>>;
        auto data = std::make_unique<typename Calls::Pointer>(std::move(object));
        antumbra_user_geometry functions = Calls::user_geometry(data.get());
        std::uint32_t id = 0;
        check(antumbra_scene_add_user(get(), count, &functions, &id));
        data.release();
        return id;
    }
    // Makes a triangle mesh partly transparent: `opacity` is called with a Candidate and returns a number from 0 to 1.
    template <class F> void set_opacity(std::uint32_t geom_id, F opacity) {
        using Calls = detail::Calls<F>;
        auto data = std::make_unique<typename Calls::Pointer>(std::make_shared<const F>(std::move(opacity)));
        antumbra_opacity function = Calls::opacity_of(data.get());
        check(antumbra_scene_set_opacity(get(), geom_id, &function));
        data.release();
    }
    void set_mask(std::uint32_t geom_id, std::uint32_t mask) { check(antumbra_scene_set_mask(get(), geom_id, mask)); }
    void set_origin(const std::array<double, 3> &origin) { check(antumbra_scene_set_origin(get(), origin.data())); }
    void set_positions(std::uint32_t geom_id, vectors positions) {
        check(antumbra_scene_set_positions(get(), geom_id, positions.data(), positions.size(), positions.stride()));
    }
    void set_positions_f64(std::uint32_t geom_id, vectors_f64 positions) {
        check(antumbra_scene_set_positions_f64(get(), geom_id, positions.data(), positions.size(), positions.stride()));
    }
    std::size_t geometry_count() const {
        std::size_t count = 0;
        check(antumbra_scene_geometry_count(get(), &count));
        return count;
    }
    antumbra_scene *get() noexcept { return handle_.get(); }
    const antumbra_scene *get() const noexcept { return handle_.get(); }

private:
    // An empty list of indices is a list, not the lack of one.
    template <std::size_t N> static const std::uint32_t *some(const tuples<std::uint32_t, N> &indices) noexcept {
        static const std::uint32_t none[N] = {};
        return indices.data() == nullptr ? none : indices.data();
    }

    detail::Owned<antumbra_scene, antumbra_scene_free> handle_;
};

// A recipe: see 5 in antumbra.h. Keeps the texts of its names.
class Recipe {
public:
    explicit Recipe(std::string preset = "default") : preset_(std::move(preset)) {
        check(antumbra_recipe_init(&recipe_, preset_.c_str()));
    }
    Recipe &builder(std::string name) { return builder_ = std::move(name), *this; }
    Recipe &collapse(std::string name) { return collapse_ = std::move(name), *this; }
    Recipe &order(std::string name) { return order_ = std::move(name), *this; }
    Recipe &level(std::string name) { return level_ = std::move(name), *this; }
    Recipe &width(std::uint32_t width) { return recipe_.width = width, *this; }
    Recipe &training(std::uint32_t training) { return recipe_.training = training, *this; }
    Recipe &surface_rays(std::uint64_t count) { return recipe_.surface_rays = count, *this; }
    Recipe &seed(std::uint64_t seed) { return recipe_.seed = seed, *this; }
    // The structure, for as long as the recipe lives and stays as it is.
    antumbra_recipe get() const noexcept {
        antumbra_recipe recipe = recipe_;
        recipe.preset = preset_.c_str();
        recipe.builder = text(builder_);
        recipe.collapse = text(collapse_);
        recipe.order = text(order_);
        recipe.level = text(level_);
        return recipe;
    }

private:
    static const char *text(const std::string &name) noexcept { return name.empty() ? nullptr : name.c_str(); }

    std::string preset_, builder_, collapse_, order_, level_;
    antumbra_recipe recipe_{};
};

// Options of a build. What they are given must live until the build.
class Build {
public:
    Build &recipe(const Recipe &recipe) { return recipe_ = &recipe, *this; }
    Build &rays(span<const Ray> rays) { return rays_ = rays, *this; }
    Build &threads(const Threads &threads) { return threads_ = &threads, *this; }
    // `progress` is called with a float from 0 to 1, from the threads of the build. If it throws, the build stops.
    Build &progress(std::function<void(float)> progress) { return progress_ = std::move(progress), *this; }
    // `cancelled` returns whether to stop: the build then throws an Error with the status ANTUMBRA_CANCELLED.
    Build &cancelled(std::function<bool()> cancelled) { return cancelled_ = std::move(cancelled), *this; }

    // Runs a build of C.
    template <class F> void run(F &&build) const {
        Callbacks callbacks{&progress_, &cancelled_, {}};
        antumbra_build options = antumbra_build_init();
        antumbra_recipe recipe{};
        if (recipe_ != nullptr) {
            recipe = recipe_->get();
            options.recipe = &recipe;
        }
        options.rays = rays_.data();
        options.ray_count = rays_.size();
        options.threads = threads_ == nullptr ? nullptr : threads_->get();
        options.data = &callbacks;
        if (progress_) {
            options.progress = on_progress;
        }
        if (progress_ || cancelled_) {
            options.cancelled = is_cancelled;
        }
        antumbra_status status = build(&options);
        callbacks.caught.rethrow();
        check(status);
    }

private:
    struct Callbacks {
        const std::function<void(float)> *progress;
        const std::function<bool()> *cancelled;
        detail::Caught caught;
    };
    static void on_progress(void *data, float done) {
        auto &callbacks = *static_cast<Callbacks *>(data);
        callbacks.caught.run(0, [&] { return (*callbacks.progress)(done), 0; });
    }
    static std::int32_t is_cancelled(void *data) {
        auto &callbacks = *static_cast<Callbacks *>(data);
        bool is = callbacks.caught.run(true, [&] { return *callbacks.cancelled && (*callbacks.cancelled)(); });
        return is || callbacks.caught.any() ? 1 : 0;
    }

    const Recipe *recipe_ = nullptr;
    span<const Ray> rays_;
    const Threads *threads_ = nullptr;
    std::function<void(float)> progress_;
    std::function<bool()> cancelled_;
};

// Hits of many rays, one list for each.
class HitLists {
public:
    explicit HitLists(antumbra_hit_lists *handle, std::size_t rays) : handle_(handle), rays_(rays) {
        check(antumbra_hit_lists_get(handle, &splits_, &hits_, nullptr));
    }
    // Number of rays.
    std::size_t size() const noexcept { return rays_; }
    // Hits of a ray, front to back.
    span<const Hit> operator[](std::size_t ray) const noexcept {
        return {hits_ + splits_[ray], splits_[ray + 1] - splits_[ray]};
    }

private:
    detail::Owned<antumbra_hit_lists, antumbra_hit_lists_free> handle_;
    std::size_t rays_;
    const std::size_t *splits_ = nullptr;
    const Hit *hits_ = nullptr;
};

// Primitives near points, one list for each.
class ClosestLists {
public:
    explicit ClosestLists(antumbra_closest_lists *handle, std::size_t points) : handle_(handle), points_(points) {
        check(antumbra_closest_lists_get(handle, &splits_, &items_, nullptr));
    }
    std::size_t size() const noexcept { return points_; }
    span<const ClosestPoint> operator[](std::size_t point) const noexcept {
        return {items_ + splits_[point], splits_[point + 1] - splits_[point]};
    }

private:
    detail::Owned<antumbra_closest_lists, antumbra_closest_lists_free> handle_;
    std::size_t points_;
    const std::size_t *splits_ = nullptr;
    const ClosestPoint *items_ = nullptr;
};

// Many rays with conditions: see 7 in antumbra.h. Made by View::batch(); nothing happens before the last call, which names the
// query. What it is given must live until then.
class Batch {
public:
    Batch(const antumbra_bvh *bvh, antumbra_batch batch) : bvh_(bvh), batch_(batch) {}

    Batch &tnear(tuples<float, 1> ends) { return batch_.tnear = ends.data(), batch_.tnear_stride = ends.stride(), *this; }
    Batch &tfar(tuples<float, 1> ends) { return batch_.tfar = ends.data(), batch_.tfar_stride = ends.stride(), *this; }
    Batch &closed() { return batch_.flags |= static_cast<std::uint32_t>(ANTUMBRA_CLOSED), *this; }
    Batch &on_this_thread() { return batch_.flags |= static_cast<std::uint32_t>(ANTUMBRA_THIS_THREAD), *this; }
    Batch &threads(const Threads &threads) { return batch_.threads = threads.get(), *this; }
    // ANTUMBRA_ORDER_...
    Batch &order(std::uint32_t order) { return batch_.order = order, *this; }
    // One mask for all rays.
    Batch &mask(std::uint32_t mask) { return mask_ = mask, masks_ = {}, *this; }
    // A mask for each ray.
    Batch &masks(span<const std::uint32_t> masks) { return size_of(masks), masks_ = masks, mask_.reset(), *this; }
    // A primitive for each ray that it does not hit.
    Batch &except(span<const PrimId> except) { return size_of(except), batch_.except = except.data(), *this; }
    // `accepts` is called with the number of a ray and a Hit, and returns whether the hit counts.
    Batch &filter(std::function<bool(std::size_t, const Hit &)> accepts) { return filter_ = std::move(accepts), *this; }

    std::size_t size() const noexcept { return batch_.count; }

    // A byte for each ray, 1 or 0.
    std::vector<std::uint8_t> occluded() const {
        std::vector<std::uint8_t> answers(size());
        occluded_into(answers);
        return answers;
    }
    void occluded_into(span<std::uint8_t> answers) const {
        size_of(answers);
        run([&](const antumbra_batch *batch) { return antumbra_occluded(bvh_, batch, answers.data(), 0); });
    }
    // A bit for each ray.
    std::vector<std::uint64_t> occluded_bits() const {
        std::vector<std::uint64_t> bits((size() + 63) / 64);
        run([&](const antumbra_batch *batch) { return antumbra_occluded_bits(bvh_, batch, bits.data(), bits.size()); });
        return bits;
    }
    std::vector<Hit> intersect() const {
        std::vector<Hit> answers(size());
        intersect_into(answers);
        return answers;
    }
    void intersect_into(span<Hit> answers) const {
        size_of(answers);
        run([&](const antumbra_batch *batch) { return antumbra_intersect(bvh_, batch, answers.data(), 0); });
    }
    std::vector<Surface> surfaces() const {
        std::vector<Surface> answers(size());
        surfaces_into(answers);
        return answers;
    }
    void surfaces_into(span<Surface> answers) const {
        size_of(answers);
        run([&](const antumbra_batch *batch) { return antumbra_surface_of(bvh_, batch, answers.data(), 0); });
    }
    std::vector<PrimId> occluders() const {
        std::vector<PrimId> answers(size());
        run([&](const antumbra_batch *batch) { return antumbra_occluder(bvh_, batch, answers.data(), 0); });
        return answers;
    }
    std::vector<std::uint32_t> count_hits() const {
        std::vector<std::uint32_t> answers(size());
        run([&](const antumbra_batch *batch) { return antumbra_count_hits(bvh_, batch, answers.data(), 0); });
        return answers;
    }
    HitLists all_hits() const {
        antumbra_hit_lists *lists = nullptr;
        run([&](const antumbra_batch *batch) { return antumbra_all_hits(bvh_, batch, &lists); });
        return HitLists(lists, size());
    }
    // Calls `visit` with the number of a ray and a Hit, for the hits of each ray from front to back, until it returns
    // ANTUMBRA_ACCEPT or ANTUMBRA_STOP instead of ANTUMBRA_REJECT.
    template <class F> void visit_hits(F visit) const {
        struct Visitor {
            F *visit;
            detail::Caught caught;
        } visitor{&visit, {}};
        auto call = [](void *data, std::size_t ray, const Hit *hit) -> std::int32_t {
            auto &own = *static_cast<Visitor *>(data);
            return own.caught.run(static_cast<std::int32_t>(ANTUMBRA_STOP),
                                  [&] { return static_cast<std::int32_t>((*own.visit)(ray, *hit)); });
        };
        antumbra_status status = ANTUMBRA_OK;
        run([&](const antumbra_batch *batch) {
            status = antumbra_visit_hits(bvh_, batch, call, &visitor);
            return visitor.caught.any() ? static_cast<antumbra_status>(ANTUMBRA_OK) : status;
        });
        visitor.caught.rethrow();
    }

private:
    struct Filter {
        const std::function<bool(std::size_t, const Hit &)> *accepts;
        detail::Caught caught;
    };
    static std::int32_t accepts(void *data, std::size_t ray, const Hit *hit) {
        auto &filter = *static_cast<Filter *>(data);
        return filter.caught.run(0, [&] { return (*filter.accepts)(ray, *hit) ? 1 : 0; });
    }
    template <class T> void size_of(span<T> items) const {
        if (items.size() != batch_.count) {
            throw Error(ANTUMBRA_INVALID_ARGUMENT, "an array has not as many items as the batch has rays");
        }
    }
    template <class F> void run(F &&query) const {
        Filter filter{&filter_, {}};
        antumbra_batch batch = batch_;
        if (mask_) {
            batch.masks = &*mask_;
            batch.mask_stride = same_for_all;
        } else if (!masks_.empty()) {
            batch.masks = masks_.data();
        }
        if (filter_) {
            batch.data = &filter;
            batch.filter = accepts;
        }
        antumbra_status status = query(&batch);
        filter.caught.rethrow();
        check(status);
    }

    const antumbra_bvh *bvh_;
    antumbra_batch batch_;
    std::optional<std::uint32_t> mask_;
    span<const std::uint32_t> masks_;
    std::function<bool(std::size_t, const Hit &)> filter_;
};

// Directions for groups: see 9 in antumbra.h.
class Directions {
public:
    explicit Directions(vectors directions) : size_(directions.size()) {
        antumbra_directions *handle = nullptr;
        check(antumbra_directions_new(directions.data(), directions.size(), directions.stride(), &handle));
        handle_.reset(handle);
    }
    std::size_t size() const noexcept { return size_; }
    std::size_t words_per_row() const noexcept { return (size_ + 63) / 64; }
    const antumbra_directions *get() const noexcept { return handle_.get(); }

private:
    detail::Owned<antumbra_directions, antumbra_directions_free> handle_;
    std::size_t size_;
};

// Points that look in directions. What it is given must live until the last call.
class Group {
public:
    Group(const antumbra_bvh *bvh, vectors points, const Directions &directions)
        : bvh_(bvh), group_(antumbra_group_of(points.data(), points.size())), directions_(&directions) {
        group_.point_stride = points.stride();
    }
    // Directions that are not above the surface of a point have the bit 0.
    Group &above(vectors normals) {
        return size_of(normals.size()), group_.normals = normals.data(), group_.normal_stride = normals.stride(), *this;
    }
    // Where the rays of each point begin, in lengths of the direction.
    Group &tnear(tuples<float, 1> tnear) {
        return size_of(tnear.size()), group_.tnear = tnear.data(), group_.tnear_stride = tnear.stride(), *this;
    }
    Group &tfar(float tfar) { return group_.tfar = tfar, *this; }
    Group &on_this_thread() { return group_.flags |= static_cast<std::uint32_t>(ANTUMBRA_THIS_THREAD), *this; }
    Group &threads(const Threads &threads) { return group_.threads = threads.get(), *this; }
    // Directions.words_per_row() words for each point: the bits of directions that are open.
    std::vector<std::uint64_t> open() const {
        std::vector<std::uint64_t> bits(group_.count * directions_->words_per_row());
        check(antumbra_group_open(bvh_, &group_, directions_->get(), bits.data(), directions_->words_per_row()));
        return bits;
    }

private:
    void size_of(std::size_t size) const {
        if (size != group_.count) {
            throw Error(ANTUMBRA_INVALID_ARGUMENT, "an array has not as many items as the group has points");
        }
    }

    const antumbra_bvh *bvh_;
    antumbra_group group_;
    const Directions *directions_;
};

// Points and what is near them: see 10 in antumbra.h. What it is given must live until the last call.
class Points {
public:
    Points(const antumbra_bvh *bvh, vectors points) : bvh_(bvh), points_(antumbra_points_of(points.data(), points.size())) {
        points_.point_stride = points.stride();
    }
    // One largest distance for all points.
    Points &within(float distance) { return limit_ = distance, *this; }
    // A largest distance for each point.
    Points &within(tuples<float, 1> distances) {
        if (distances.size() != points_.count) {
            throw Error(ANTUMBRA_INVALID_ARGUMENT, "there are not as many distances as points");
        }
        limit_.reset();
        return points_.max_distances = distances.data(), points_.max_distance_stride = distances.stride(), *this;
    }
    Points &on_this_thread() { return points_.flags |= static_cast<std::uint32_t>(ANTUMBRA_THIS_THREAD), *this; }
    Points &threads(const Threads &threads) { return points_.threads = threads.get(), *this; }

    std::vector<ClosestPoint> closest() const { return answers<ClosestPoint>(antumbra_closest); }
    // A byte for each point, 1 or 0.
    std::vector<std::uint8_t> inside() const { return answers<std::uint8_t>(antumbra_contains); }
    std::vector<float> signed_distances() const { return answers<float>(antumbra_signed_distance); }
    std::vector<std::int32_t> winding_numbers() const { return answers<std::int32_t>(antumbra_winding_number); }
    // All primitives within the largest distance of each point, which must be given.
    ClosestLists all() const {
        antumbra_closest_lists *lists = nullptr;
        antumbra_points points = options();
        check(antumbra_within(bvh_, &points, &lists));
        return ClosestLists(lists, points_.count);
    }

private:
    antumbra_points options() const {
        antumbra_points points = points_;
        if (limit_) {
            points.max_distances = &*limit_;
            points.max_distance_stride = same_for_all;
        }
        return points;
    }
    template <class A, class F> std::vector<A> answers(F query) const {
        std::vector<A> answers(points_.count);
        antumbra_points points = options();
        check(query(bvh_, &points, answers.data(), 0));
        return answers;
    }

    const antumbra_bvh *bvh_;
    antumbra_points points_;
    std::optional<float> limit_;
};

// A tree that answers queries and belongs to somebody else.
class View {
public:
    explicit View(const antumbra_bvh *handle) noexcept : handle_(handle) {}

    bool occluded(const Ray &ray) const {
        bool answer = false;
        check(antumbra_occluded1(handle_, &ray, &answer));
        return answer;
    }
    std::optional<Hit> intersect(const Ray &ray) const {
        Hit hit;
        check(antumbra_intersect1(handle_, &ray, &hit));
        return is_hit(hit) ? std::optional<Hit>(hit) : std::nullopt;
    }
    std::optional<Surface> surface(const Ray &ray) const {
        Surface found;
        check(antumbra_surface1(handle_, &ray, &found));
        return is_hit(found) ? std::optional<Surface>(found) : std::nullopt;
    }
    std::optional<PrimId> occluder(const Ray &ray) const {
        PrimId found;
        check(antumbra_occluder1(handle_, &ray, &found));
        return found.geom_id != invalid_id ? std::optional<PrimId>(found) : std::nullopt;
    }
    Batch batch(span<const Ray> rays) const { return Batch(handle_, antumbra_batch_of(rays.data(), rays.size())); }
    // Rays that are a part of your own structures: `first` is that of the first structure, `stride` the bytes of a structure.
    Batch batch(const Ray *first, std::size_t count, std::size_t stride) const {
        antumbra_batch batch = antumbra_batch_of(first, count);
        batch.ray_stride = stride;
        return Batch(handle_, batch);
    }
    // Rays in arrays of their own, over the interval (0, infinity).
    Batch batch(vectors origins, vectors directions) const {
        if (origins.size() != directions.size()) {
            throw Error(ANTUMBRA_INVALID_ARGUMENT, "there are not as many origins as directions");
        }
        antumbra_batch batch = antumbra_batch_of_arrays(origins.data(), directions.data(), origins.size());
        batch.origin_stride = origins.stride();
        batch.direction_stride = directions.stride();
        return Batch(handle_, batch);
    }
    Group group(vectors points, const Directions &directions) const { return Group(handle_, points, directions); }
    Points points(vectors points) const { return Points(handle_, points); }

    Report report() const {
        Report report;
        check(antumbra_bvh_report(handle_, &report));
        return report;
    }
    Box bounds() const {
        Box box;
        check(antumbra_bvh_bounds(handle_, &box, nullptr));
        return box;
    }
    // How far from a surface rays that leave it should begin.
    float origin_offset() const {
        float offset = 0;
        check(antumbra_bvh_bounds(handle_, nullptr, &offset));
        return offset;
    }
    double quality() const {
        double quality = 0;
        check(antumbra_bvh_quality(handle_, &quality));
        return quality;
    }
    const antumbra_bvh *get() const noexcept { return handle_; }

protected:
    const antumbra_bvh *handle_;
};

// Functions that files cannot hold, in the order of geometries: see 12 in antumbra.h.
class Functions {
public:
    // The object of a user geometry, as for Scene::add_user().
    template <class T> Functions &user(std::shared_ptr<T> object) {
        using Calls = detail::Calls<std::remove_const_t<T>>;
        typename Calls::Pointer kept(std::move(object));
        users_.push_back([kept] { return Calls::user_geometry(new typename Calls::Pointer(kept)); });
        return *this;
    }
    // The function of a mesh with an opacity.
    template <class F> Functions &opacity(F function) {
        using Calls = detail::Calls<F>;
        typename Calls::Pointer kept = std::make_shared<const F>(std::move(function));
        opacities_.push_back([kept] { return Calls::opacity_of(new typename Calls::Pointer(kept)); });
        return *this;
    }
    // Runs a function of C that loads something.
    template <class F> void run(F &&load) const {
        Given given;
        given.users.reserve(users_.size());
        given.opacities.reserve(opacities_.size());
        std::vector<const antumbra_user_geometry *> users;
        std::vector<const antumbra_opacity *> opacities;
        for (const auto &make : users_) {
            given.users.push_back(make());
            users.push_back(&given.users.back());
        }
        for (const auto &make : opacities_) {
            given.opacities.push_back(make());
            opacities.push_back(&given.opacities.back());
        }
        antumbra_functions functions = antumbra_functions_init();
        functions.user_geometries = users.data();
        functions.user_geometry_count = users.size();
        functions.opacities = opacities.data();
        functions.opacity_count = opacities.size();
        check(load(&functions));
        given.users.clear();
        given.opacities.clear();
    }

private:
    // Releases what nobody took over.
    struct Given {
        std::vector<antumbra_user_geometry> users;
        std::vector<antumbra_opacity> opacities;
        Given() = default;
        Given(const Given &) = delete;
        Given &operator=(const Given &) = delete;
        ~Given() {
            for (auto &functions : users) {
                functions.release(functions.data);
            }
            for (auto &function : opacities) {
                function.release(function.data);
            }
        }
    };
    std::vector<std::function<antumbra_user_geometry()>> users_;
    std::vector<std::function<antumbra_opacity()>> opacities_;
};

// The order of children that a tree or a world learned.
class ChildOrder {
public:
    explicit ChildOrder(antumbra_child_order *handle) noexcept : handle_(handle) {}
    const antumbra_child_order *get() const noexcept { return handle_.get(); }

private:
    detail::Owned<antumbra_child_order, antumbra_child_order_free> handle_;
};

// A tree.
class Bvh : public View {
public:
    explicit Bvh(const Scene &scene, const Build &options = Build()) : View(nullptr) {
        antumbra_bvh *handle = nullptr;
        options.run([&](const antumbra_build *build) { return antumbra_bvh_build(scene.get(), build, &handle); });
        own(handle);
    }
    // A ground, objects and instances, none of which moves. `ground` may be null.
    Bvh(const Scene *ground, span<const Scene> objects, span<const Instance> instances, const Build &options = Build())
        : View(nullptr) {
        std::vector<const antumbra_scene *> handles;
        for (const Scene &object : objects) {
            handles.push_back(object.get());
        }
        antumbra_bvh *handle = nullptr;
        options.run([&](const antumbra_build *build) {
            return antumbra_bvh_build_instances(ground == nullptr ? nullptr : ground->get(), handles.data(), handles.size(),
                                                instances.data(), instances.size(), build, &handle);
        });
        own(handle);
    }
    Bvh(Bvh &&other) noexcept : View(std::exchange(other.handle_, nullptr)), owned_(std::move(other.owned_)) {}
    Bvh &operator=(Bvh &&other) noexcept {
        handle_ = std::exchange(other.handle_, nullptr);
        owned_ = std::move(other.owned_);
        return *this;
    }
    static Bvh load(const std::string &path, const Functions &functions = Functions()) {
        antumbra_bvh *handle = nullptr;
        functions.run([&](const antumbra_functions *given) { return antumbra_bvh_load(path.c_str(), given, &handle); });
        Bvh bvh;
        bvh.own(handle);
        return bvh;
    }
    void save(const std::string &path) const { check(antumbra_bvh_save(get(), path.c_str())); }
    // Masks of geometries, see antumbra_bvh_set_masks().
    void set_masks(span<const std::uint32_t> masks) { check(antumbra_bvh_set_masks(owned_.get(), masks.data(), masks.size())); }
    void refit(const Scene &scene, const Threads *threads = nullptr) {
        check(antumbra_bvh_refit(owned_.get(), scene.get(), threads == nullptr ? nullptr : threads->get()));
    }
    // Learns the child order again, and returns it for copies of the tree.
    ChildOrder relearn(span<const Ray> rays, const Recipe &recipe = Recipe()) {
        antumbra_recipe choices = recipe.get();
        antumbra_child_order *learned = nullptr;
        check(antumbra_bvh_relearn(owned_.get(), rays.data(), rays.size(), 0, &choices, &learned));
        return ChildOrder(learned);
    }
    void adopt(const ChildOrder &order) { check(antumbra_bvh_adopt(owned_.get(), order.get())); }
    Bvh copy() const {
        antumbra_bvh *handle = nullptr;
        check(antumbra_bvh_copy(owned_.get(), &handle));
        Bvh bvh;
        bvh.own(handle);
        return bvh;
    }

private:
    Bvh() noexcept : View(nullptr) {}
    void own(antumbra_bvh *handle) noexcept {
        owned_.reset(handle);
        handle_ = handle;
    }

    detail::Owned<antumbra_bvh, antumbra_bvh_free> owned_;
};

// Geometry with its tree, to be placed in worlds.
class Object {
public:
    explicit Object(const Scene &scene, const Build &options = Build()) {
        antumbra_object *handle = nullptr;
        options.run([&](const antumbra_build *build) { return antumbra_object_build(scene.get(), build, &handle); });
        handle_.reset(handle);
    }
    static Object load(const std::string &path, const Functions &functions = Functions()) {
        antumbra_object *handle = nullptr;
        functions.run([&](const antumbra_functions *given) { return antumbra_object_load(path.c_str(), given, &handle); });
        return Object(handle);
    }
    void save(const std::string &path) const { check(antumbra_object_save(get(), path.c_str())); }
    // Its tree, which lives as long as the object.
    View bvh() const {
        const antumbra_bvh *bvh = nullptr;
        check(antumbra_object_bvh(get(), &bvh));
        return View(bvh);
    }
    const antumbra_object *get() const noexcept { return handle_.get(); }

private:
    explicit Object(antumbra_object *handle) noexcept : handle_(handle) {}
    detail::Owned<antumbra_object, antumbra_object_free> handle_;
};

// Objects that instances place, and that may move: see 11 in antumbra.h.
class World {
public:
    World(span<const Object> objects, span<const Instance> instances, const Object *ground = nullptr,
          const Threads *threads = nullptr) {
        std::vector<const antumbra_object *> handles;
        for (const Object &object : objects) {
            handles.push_back(object.get());
        }
        antumbra_world *handle = nullptr;
        check(antumbra_world_new(ground == nullptr ? nullptr : ground->get(), handles.data(), handles.size(), instances.data(),
                                 instances.size(), threads == nullptr ? nullptr : threads->get(), &handle));
        handle_.reset(handle);
    }
    static World load(const std::string &path, const Functions &functions = Functions()) {
        antumbra_world *handle = nullptr;
        functions.run([&](const antumbra_functions *given) { return antumbra_world_load(path.c_str(), given, &handle); });
        return World(handle);
    }
    void save(const std::string &path) const { check(antumbra_world_save(handle_.get(), path.c_str())); }
    // The tree over everything, which lives as long as the world, also when instances change.
    View bvh() const {
        const antumbra_bvh *bvh = nullptr;
        check(antumbra_world_bvh(handle_.get(), &bvh));
        return View(bvh);
    }
    void set_instances(span<const Instance> instances, const Threads *threads = nullptr) {
        check(antumbra_world_set_instances(handle_.get(), instances.data(), instances.size(),
                                           threads == nullptr ? nullptr : threads->get()));
    }
    // Moves the vertices of one object, and replaces the list of instances.
    void refit(std::uint32_t object, const Scene &scene, span<const Instance> instances, const Threads *threads = nullptr) {
        const antumbra_scene *moved = scene.get();
        check(antumbra_world_refit(handle_.get(), &object, &moved, 1, instances.data(), instances.size(),
                                   threads == nullptr ? nullptr : threads->get()));
    }
    // Adds an object and returns its index.
    std::uint32_t add_object(const Object &object) {
        std::uint32_t index = 0;
        check(antumbra_world_add_object(handle_.get(), object.get(), &index));
        return index;
    }
    // Masks of the geometries of an object, or of the ground with invalid_id.
    void set_masks(std::uint32_t object, span<const std::uint32_t> masks) {
        check(antumbra_world_set_masks(handle_.get(), object, masks.data(), masks.size()));
    }
    ChildOrder relearn(span<const Ray> rays, const Recipe &recipe = Recipe()) {
        antumbra_recipe choices = recipe.get();
        antumbra_child_order *learned = nullptr;
        check(antumbra_world_relearn(handle_.get(), rays.data(), rays.size(), 0, &choices, &learned));
        return ChildOrder(learned);
    }
    void adopt(const ChildOrder &order) { check(antumbra_world_adopt(handle_.get(), order.get())); }
    World copy() const {
        antumbra_world *handle = nullptr;
        check(antumbra_world_copy(handle_.get(), &handle));
        return World(handle);
    }
    double quality(std::uint32_t object) const {
        double quality = 0;
        check(antumbra_world_quality(handle_.get(), object, &quality));
        return quality;
    }

private:
    explicit World(antumbra_world *handle) noexcept : handle_(handle) {}
    detail::Owned<antumbra_world, antumbra_world_free> handle_;
};

// Heights of the cells of a raster, and what these see: see 13 in antumbra.h.
class HeightField {
public:
    using Transform = std::array<double, 6>;

    // Rows of so many columns. NAN is no data.
    HeightField(span<const double> heights, std::size_t columns, const Transform &transform = {0, 1, 0, 0, 0, -1})
        : cells_(heights.size()) {
        if (columns == 0 || heights.size() % columns != 0) {
            throw Error(ANTUMBRA_INVALID_ARGUMENT, "the heights are not rows of so many columns");
        }
        antumbra_height_field *handle = nullptr;
        check(antumbra_height_field_new(heights.data(), heights.size() / columns, columns, 0, transform.data(), &handle));
        handle_.reset(handle);
    }
    std::size_t cells() const noexcept { return cells_; }
    // Azimuths of a lattice, in degrees.
    std::vector<double> lattice(std::size_t count) const {
        std::vector<double> azimuths(count);
        check(antumbra_height_field_lattice(handle_.get(), count, azimuths.data()));
        return azimuths;
    }
    // Elevation of the horizon of each cell, in degrees.
    std::vector<float> horizons(double azimuth, double rise = 0, double drop = 0, const Threads *threads = nullptr) const {
        std::vector<float> angles(cells_);
        check(antumbra_height_field_horizons(handle_.get(), azimuth, rise, drop, some(threads), angles.data()));
        return angles;
    }
    // ANTUMBRA_SKY_VIEW and others, from a lattice of so many azimuths.
    std::vector<float> sky(std::uint32_t measure, std::size_t azimuths = 16, double rise = 0,
                           const Threads *threads = nullptr) const {
        std::vector<float> values(cells_);
        check(antumbra_height_field_sky(handle_.get(), azimuths, measure, rise, some(threads), values.data()));
        return values;
    }
    // Which cells see lights, each an azimuth and an elevation in degrees: for each light all cells.
    std::vector<std::uint8_t> lit(tuples<double, 2> lights, double rise = 0, const Threads *threads = nullptr) const {
        std::vector<std::uint8_t> lit(lights.size() * cells_);
        check(antumbra_height_field_lit(handle_.get(), lights.data(), lights.size(), lights.stride(), rise, some(threads),
                                        lit.data()));
        return lit;
    }
    // Height of the surface; NAN beside it.
    double height(double x, double y) const {
        double height = 0;
        check(antumbra_height_field_height(handle_.get(), x, y, &height));
        return height;
    }
    // Which cells an eye sees. Its z may be NAN for one on the surface.
    std::vector<std::uint8_t> viewshed(const std::array<double, 3> &eye, double target = 0, double radius = HUGE_VAL,
                                       double drop = 0, const Threads *threads = nullptr) const {
        std::vector<std::uint8_t> seen(cells_);
        check(antumbra_height_field_viewshed(handle_.get(), eye.data(), target, radius, drop, some(threads), seen.data()));
        return seen;
    }
    const antumbra_height_field *get() const noexcept { return handle_.get(); }

private:
    static const antumbra_threads *some(const Threads *threads) noexcept {
        return threads == nullptr ? nullptr : threads->get();
    }
    std::size_t cells_;
    detail::Owned<antumbra_height_field, antumbra_height_field_free> handle_;
};

} // namespace antumbra

#endif
