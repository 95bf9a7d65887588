#include "cli/signals.h"

#include <unistd.h>

#include <array>
#include <atomic>
#include <csignal>

namespace brume {
namespace {

enum class AtStop { Die, LeaveCheckpoint, Remember };

std::atomic<int> received{0};
std::atomic<bool> hung_up{false};
std::atomic<AtStop> at_stop{AtStop::Die};
static_assert(std::atomic<int>::is_always_lock_free && std::atomic<bool>::is_always_lock_free &&
                  std::atomic<AtStop>::is_always_lock_free,
              "the handler may touch nothing that locks");

constexpr std::array kStopSignals{SIGINT, SIGTERM, SIGUSR1};
constexpr int kStoppedExit = 75;
std::array<struct sigaction, kStopSignals.size()> previous;
struct sigaction previous_hangup;

void handle_stop(int number) {
  switch (at_stop.load()) {
    case AtStop::Remember:
      received.store(number);
      return;
    case AtStop::LeaveCheckpoint: {
      constexpr char kMessage[] =
          "error: stopped before anything was added: the same command goes on from the cache\n";
      [[maybe_unused]] const ssize_t ignored = write(STDERR_FILENO, kMessage, sizeof kMessage - 1);
      _exit(kStoppedExit);
    }
    case AtStop::Die:
      // The handler is gone (SA_RESETHAND); delivered when this one returns.
      raise(number);
  }
}

void handle_hangup(int) { hung_up.store(true); }

}  // namespace

SignalWatch::SignalWatch(bool has_checkpoint) {
  received.store(0);
  hung_up.store(false);
  set_checkpoint(has_checkpoint);
  struct sigaction action {};
  action.sa_handler = handle_stop;
  sigemptyset(&action.sa_mask);
  // Restarted system calls: a write in progress must not fail half way. Reset: the second signal
  // kills.
  action.sa_flags = static_cast<int>(SA_RESTART | SA_RESETHAND);
  for (std::size_t i = 0; i < kStopSignals.size(); ++i)
    sigaction(kStopSignals[i], &action, &previous[i]);
  struct sigaction hangup {};
  hangup.sa_handler = handle_hangup;
  sigemptyset(&hangup.sa_mask);
  hangup.sa_flags = SA_RESTART;
  sigaction(SIGHUP, &hangup, &previous_hangup);
}

SignalWatch::~SignalWatch() {
  for (std::size_t i = 0; i < kStopSignals.size(); ++i)
    sigaction(kStopSignals[i], &previous[i], nullptr);
  sigaction(SIGHUP, &previous_hangup, nullptr);
}

void SignalWatch::set_checkpoint(bool has_checkpoint) {
  at_stop.store(has_checkpoint ? AtStop::LeaveCheckpoint : AtStop::Die);
}

void SignalWatch::remember() { at_stop.store(AtStop::Remember); }

int SignalWatch::signal() { return received.load(); }

bool SignalWatch::take_hangup() { return hung_up.load() && hung_up.exchange(false); }

}  // namespace brume
