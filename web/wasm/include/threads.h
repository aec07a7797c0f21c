#ifndef LATHE_THREADS_H
#define LATHE_THREADS_H
typedef int once_flag;
#define ONCE_FLAG_INIT 0
static inline void call_once(once_flag *flag, void (*function)(void)) {
    if (!*flag) function();
    *flag = 1;
}
#endif
