#include "interposer.hpp"

#include <pthread.h>
#include <semaphore.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <condition_variable>
#include <cstdarg>
#include <cstdlib>
#include <mutex>
#include <new>
#include <semaphore>
#include <shared_mutex>
#include <thread>
#include <vector>

namespace {

// Volatile: the compiler may not leave out a pair of new and delete that it can see through.
thread_local volatile std::size_t allocations = 0;
thread_local volatile std::size_t releases = 0;
thread_local volatile std::size_t locks = 0;

void count(volatile std::size_t& what) noexcept { what = what + 1; }

}  // namespace

// The linker's names: `__wrap_f` is called in place of f, which is `__real_f` here.
// NOLINTBEGIN(bugprone-reserved-identifier, readability-identifier-naming)
#define COUNTED(kind, result, name, parameters, arguments) \
  result __real_##name parameters;                         \
  result __wrap_##name parameters;                         \
  result __wrap_##name parameters {                        \
    count(kind);                                           \
    return __real_##name arguments;                        \
  }

extern "C" {
COUNTED(allocations, void*, malloc, (std::size_t size), (size))
COUNTED(allocations, void*, calloc, (std::size_t number, std::size_t size), (number, size))
COUNTED(allocations, void*, realloc, (void* memory, std::size_t size), (memory, size))
COUNTED(allocations, void*, aligned_alloc, (std::size_t alignment, std::size_t size), (alignment, size))
COUNTED(allocations, int, posix_memalign, (void** memory, std::size_t alignment, std::size_t size),
        (memory, alignment, size))
COUNTED(releases, void, free, (void* memory), (memory))

COUNTED(locks, int, pthread_mutex_lock, (pthread_mutex_t * mutex), (mutex))
COUNTED(locks, int, pthread_mutex_trylock, (pthread_mutex_t * mutex), (mutex))
COUNTED(locks, int, pthread_mutex_timedlock, (pthread_mutex_t * mutex, const timespec* until), (mutex, until))
COUNTED(locks, int, pthread_mutex_clocklock, (pthread_mutex_t * mutex, clockid_t clock, const timespec* until),
        (mutex, clock, until))
COUNTED(locks, int, pthread_rwlock_rdlock, (pthread_rwlock_t * lock), (lock))
COUNTED(locks, int, pthread_rwlock_wrlock, (pthread_rwlock_t * lock), (lock))
COUNTED(locks, int, pthread_rwlock_tryrdlock, (pthread_rwlock_t * lock), (lock))
COUNTED(locks, int, pthread_rwlock_trywrlock, (pthread_rwlock_t * lock), (lock))
COUNTED(locks, int, pthread_spin_lock, (pthread_spinlock_t * lock), (lock))
COUNTED(locks, int, pthread_cond_wait, (pthread_cond_t * condition, pthread_mutex_t* mutex), (condition, mutex))
COUNTED(locks, int, pthread_cond_timedwait, (pthread_cond_t * condition, pthread_mutex_t* mutex, const timespec* until),
        (condition, mutex, until))
COUNTED(locks, int, pthread_cond_clockwait,
        (pthread_cond_t * condition, pthread_mutex_t* mutex, clockid_t clock, const timespec* until),
        (condition, mutex, clock, until))
COUNTED(locks, int, pthread_cond_signal, (pthread_cond_t * condition), (condition))
COUNTED(locks, int, pthread_cond_broadcast, (pthread_cond_t * condition), (condition))
COUNTED(locks, int, sem_wait, (sem_t * semaphore), (semaphore))
COUNTED(locks, int, sem_post, (sem_t * semaphore), (semaphore))
COUNTED(locks, int, __cxa_guard_acquire, (void* guard), (guard))
// std::condition_variable, whose code lies in a shared library, by its names there.
COUNTED(locks, void, _ZNSt18condition_variable4waitERSt11unique_lockISt5mutexE, (void* condition, void* lock),
        (condition, lock))
COUNTED(locks, void, _ZNSt18condition_variable10notify_oneEv, (void* condition), (condition))
COUNTED(locks, void, _ZNSt18condition_variable10notify_allEv, (void* condition), (condition))

// What std::atomic::wait, std::counting_semaphore and std::latch come down to.
long __real_syscall(long number, long a, long b, long c, long d, long e, long f);
// Its callers pass fewer than the six arguments that it hands on, which AddressSanitizer would take for a mistake.
long __wrap_syscall(long number, ...);
[[gnu::no_sanitize_address]] long __wrap_syscall(long number, ...) {
  count(locks);
  std::va_list rest;
  va_start(rest, number);
  std::array<long, 6> a{};
  for (long& argument : a) argument = va_arg(rest, long);
  va_end(rest);
  return __real_syscall(number, a[0], a[1], a[2], a[3], a[4], a[5]);
}
}
#undef COUNTED

namespace {

void* allocate(std::size_t size, std::size_t alignment) {
  count(allocations);
  void* memory = __real_aligned_alloc(alignment, (size + alignment - 1) / alignment * alignment);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}

// Out of line, or GCC takes free() of what operator new gave for a mistake.
[[gnu::noinline]] void release(void* memory) noexcept {
  count(releases);
  __real_free(memory);
}

}  // namespace
// NOLINTEND(bugprone-reserved-identifier, readability-identifier-naming)

void* operator new(std::size_t size) { return allocate(size, alignof(std::max_align_t)); }
void* operator new[](std::size_t size) { return allocate(size, alignof(std::max_align_t)); }
void* operator new(std::size_t size, std::align_val_t alignment) {
  return allocate(size, static_cast<std::size_t>(alignment));
}
void* operator new[](std::size_t size, std::align_val_t alignment) {
  return allocate(size, static_cast<std::size_t>(alignment));
}
void operator delete(void* memory) noexcept { release(memory); }
void operator delete[](void* memory) noexcept { release(memory); }
void operator delete(void* memory, std::size_t) noexcept { release(memory); }
void operator delete[](void* memory, std::size_t) noexcept { release(memory); }
void operator delete(void* memory, std::align_val_t) noexcept { release(memory); }
void operator delete[](void* memory, std::align_val_t) noexcept { release(memory); }
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept { release(memory); }
void operator delete[](void* memory, std::size_t, std::align_val_t) noexcept { release(memory); }

namespace interposer {

Calls calls() noexcept { return {allocations, releases, locks}; }

namespace {

template <class Deed>
Calls calls_of(Deed&& deed) {
  const Calls before = calls();
  deed();
  return calls() - before;
}

struct Slow {
  Slow() noexcept : address(reinterpret_cast<std::size_t>(this)) {}
  volatile std::size_t address;
};
void guarded_static() {
  static const Slow once;
  static_cast<void>(once.address);
}

}  // namespace

const char* blind_spot() {
  const Calls one = calls_of([] { const std::vector<double> probe(100, 1.0); });
  if (one.allocations != 1 || one.releases != 1) return "operator new and delete";
  const Calls two = calls_of([] {
    void* volatile memory = std::malloc(64);  // NOLINT(cppcoreguidelines-no-malloc)
    std::free(memory);                        // NOLINT(cppcoreguidelines-no-malloc)
  });
  if (two.allocations != 1 || two.releases != 1) return "malloc and free";

  std::mutex mutex;
  if (calls_of([&] { const std::lock_guard lock(mutex); }).locks != 1) return "a mutex";
  if (calls_of([&] {
        if (mutex.try_lock()) mutex.unlock();
      }).locks != 1)
    return "a mutex that is tried";
  std::shared_mutex shared;
  if (calls_of([&] { const std::shared_lock lock(shared); }).locks != 1) return "a lock for reading";
  if (calls_of([&] { const std::unique_lock lock(shared); }).locks != 1) return "a lock for writing";
  std::condition_variable condition;
  if (calls_of([&] { condition.notify_one(); }).locks != 1) return "a condition that is told";
  if (calls_of([&] {
        std::unique_lock lock(mutex);
        condition.wait_for(lock, std::chrono::microseconds(1));
      }).locks != 2) {
    return "a condition that is waited for";
  }
  std::atomic<int> flag = 0;
  std::thread waker([&] {
    flag = 1;
    flag.notify_one();
  });
  flag.wait(0);
  waker.join();
  std::counting_semaphore<1> semaphore(0);
  std::size_t futexes = 0;
  for (int attempt = 0; attempt < 100 && futexes == 0; ++attempt) {  // it spins first, on a busy machine all the time
    futexes = calls_of([&] { static_cast<void>(semaphore.try_acquire_for(std::chrono::milliseconds(2))); }).locks;
  }
  if (futexes == 0) return "a semaphore, which is a futex";
  if (calls_of(guarded_static).locks != 1) return "a static object in a function";
  return nullptr;
}

}  // namespace interposer
