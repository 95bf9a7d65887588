// Being asked to stop, or to show what there is, while work that can do so cleanly is going on.
#pragma once

namespace brume {

// While one lives, the first INT, TERM or USR1 either ends the process at once or is only
// remembered; a second one kills as ever. HUP is only remembered. One at a time.
class SignalWatch {
 public:
  // Ends the process at once, until remember(): there is nothing to seal yet. With exit code 75
  // where `has_checkpoint` says that an earlier run left one, else as without a watch.
  explicit SignalWatch(bool has_checkpoint = false);
  ~SignalWatch();
  SignalWatch(const SignalWatch&) = delete;
  SignalWatch& operator=(const SignalWatch&) = delete;

  static void set_checkpoint(bool has_checkpoint);
  static void remember();

  // 0 while nobody has asked. Any thread.
  static int signal();
  static bool stop_requested() { return signal() != 0; }
  // True once for HUPs since it was last asked. Any thread.
  static bool take_hangup();
};

}  // namespace brume
