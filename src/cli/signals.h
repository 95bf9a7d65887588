// Being asked to stop: INT, TERM and USR1 are remembered while work that can stop cleanly is going
// on.
#pragma once

namespace brume {

// While one lives, the first INT, TERM or USR1 is only remembered, a second one kills as ever, and
// HUP is ignored. One at a time.
class SignalWatch {
 public:
  SignalWatch();
  ~SignalWatch();
  SignalWatch(const SignalWatch&) = delete;
  SignalWatch& operator=(const SignalWatch&) = delete;

  // 0 while nobody has asked. Any thread.
  static int signal();
  static bool stop_requested() { return signal() != 0; }
};

}  // namespace brume
