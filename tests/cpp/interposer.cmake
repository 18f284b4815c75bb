# shapegcode_count_calls(target): allocations and locks of what is linked statically into `target` are counted.
set(shapegcode_interposer_dir ${CMAKE_CURRENT_LIST_DIR})
set(shapegcode_counted_calls
    malloc
    calloc
    realloc
    aligned_alloc
    posix_memalign
    free
    pthread_mutex_lock
    pthread_mutex_trylock
    pthread_mutex_timedlock
    pthread_mutex_clocklock
    pthread_rwlock_rdlock
    pthread_rwlock_wrlock
    pthread_rwlock_tryrdlock
    pthread_rwlock_trywrlock
    pthread_spin_lock
    pthread_cond_wait
    pthread_cond_timedwait
    pthread_cond_clockwait
    pthread_cond_signal
    pthread_cond_broadcast
    sem_wait
    sem_post
    syscall
    # Of static objects in functions, and std::condition_variable, whose code lies in the C++ library.
    __cxa_guard_acquire
    _ZNSt18condition_variable4waitERSt11unique_lockISt5mutexE
    _ZNSt18condition_variable10notify_oneEv
    _ZNSt18condition_variable10notify_allEv)
list(TRANSFORM shapegcode_counted_calls PREPEND "-Wl,--wrap=")

function(shapegcode_count_calls target)
  target_sources(${target} PRIVATE ${shapegcode_interposer_dir}/interposer.cpp)
  target_include_directories(${target} PRIVATE ${shapegcode_interposer_dir})
  target_link_options(${target} PRIVATE ${shapegcode_counted_calls})
endfunction()
