#include "cli/signals.h"

#include <array>
#include <atomic>
#include <csignal>

namespace brume {
namespace {

std::atomic<int> received{0};
static_assert(std::atomic<int>::is_always_lock_free, "the handler may touch nothing that locks");

constexpr std::array kStopSignals{SIGINT, SIGTERM, SIGUSR1};
std::array<struct sigaction, kStopSignals.size()> previous;
struct sigaction previous_hangup;

void remember(int number) { received.store(number); }

}  // namespace

SignalWatch::SignalWatch() {
  received.store(0);
  struct sigaction action {};
  action.sa_handler = remember;
  sigemptyset(&action.sa_mask);
  // Restarted system calls: a write in progress must not fail half way. Reset: the second signal
  // kills.
  action.sa_flags = static_cast<int>(SA_RESTART | SA_RESETHAND);
  for (std::size_t i = 0; i < kStopSignals.size(); ++i)
    sigaction(kStopSignals[i], &action, &previous[i]);
  struct sigaction ignore {};
  ignore.sa_handler = SIG_IGN;
  sigemptyset(&ignore.sa_mask);
  sigaction(SIGHUP, &ignore, &previous_hangup);
}

SignalWatch::~SignalWatch() {
  for (std::size_t i = 0; i < kStopSignals.size(); ++i)
    sigaction(kStopSignals[i], &previous[i], nullptr);
  sigaction(SIGHUP, &previous_hangup, nullptr);
}

int SignalWatch::signal() { return received.load(); }

}  // namespace brume
