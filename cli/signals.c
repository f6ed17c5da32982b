#include "signals.h"

#include <signal.h>
#include <string.h>
#include <unistd.h>

/* A handler can reach nothing but what is global. */
static volatile sig_atomic_t interrupted;

static void on_signal(int signal)
{
    (void)signal;
    static const char line[] =
        "\napsm: stopping at the next safe point; once more to stop at once\n";
    if (!interrupted && write(STDERR_FILENO, line, sizeof line - 1) < 0) { /* nothing to be done */
    }
    interrupted = 1;
}

/* A signal that our parent ignores (nohup, a background job) stays ignored. */
static void catch_one(int signal)
{
    struct sigaction before, action;
    if (sigaction(signal, NULL, &before) != 0 || before.sa_handler == SIG_IGN) return;
    memset(&action, 0, sizeof action);
    action.sa_handler = on_signal;
    action.sa_flags = SA_RESTART | (int)SA_RESETHAND;
    sigemptyset(&action.sa_mask);
    sigaction(signal, &action, NULL);
}

const volatile int *cli_catch_signals(void)
{
    catch_one(SIGINT);
    catch_one(SIGTERM);
    catch_one(SIGHUP);
    signal(SIGPIPE, SIG_IGN);
    signal(SIGXFSZ, SIG_IGN);
    return &interrupted;
}
