// Integration: the program in a process of its own, and signals.

#include <chrono>
#include <memory>
#include <stdexcept>
#include <thread>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include "tests/support/server_client.h"

namespace catgs::test {
namespace {

using testing::HasSubstr;

/// catgs-server on a port of the system's choice, serving synth:city. Its end kills it.
class Program {
 public:
  Program() {
    int log_pipe[2];
    if (::pipe(log_pipe) != 0) throw std::runtime_error("no pipe");
    pid_ = ::fork();
    if (pid_ < 0) throw std::runtime_error("no process");
    if (pid_ == 0) {
      ::dup2(log_pipe[1], STDERR_FILENO);
      ::execl(CATGS_SERVER_PROGRAM, "catgs-server", "--scene", "synth:city:2000", "--port", "0",
              "--admin-bind", "off", "--drain-wait", "1", static_cast<char*>(nullptr));
      ::_exit(127);
    }
    ::close(log_pipe[1]);
    log_end_ = log_pipe[0];
    char buffer[512];
    for (ssize_t n; log_.find("Ctrl-C") == std::string::npos &&
                    (n = ::read(log_end_, buffer, sizeof buffer)) > 0;)
      log_.append(buffer, static_cast<std::size_t>(n));
  }
  ~Program() {
    if (pid_ > 0) {
      ::kill(pid_, SIGKILL);
      wait();
    }
    ::close(log_end_);
  }
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;

  /// What it said until it was ready.
  [[nodiscard]] const std::string& log() const { return log_; }
  [[nodiscard]] int port() const {
    const std::string host = "http://127.0.0.1:";
    return std::stoi(log_.substr(log_.rfind(host) + host.size()));
  }
  void signal(int number) const { ::kill(pid_, number); }
  /// Its wait status.
  int wait() {
    int status = 0;
    ::waitpid(std::exchange(pid_, -1), &status, 0);
    return status;
  }

 private:
  pid_t pid_ = -1;
  int log_end_ = -1;
  std::string log_;
};

TEST(ServerProgram, EndsCleanlyOnSigterm) {
  Program program;
  EXPECT_THAT(program.log(), HasSubstr("http://127.0.0.1:"));
  EXPECT_THAT(program.log(), HasSubstr("renderer: CPU"));
  EXPECT_EQ(http_get(program.port(), "/readyz").status, 200);
  program.signal(SIGTERM);
  while (http_get(program.port(), "/readyz").status != 503)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  EXPECT_EQ(http_get(program.port(), "/healthz").status, 200) << "proxies see it go";
  const int status = program.wait();
  EXPECT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 0);
}

TEST(ServerProgram, SessionsGoOnAfterItWasStopped) {
  Program program;
  auto client = std::make_unique<WireClient>(program.port());
  const v1::Welcome welcome = client->greet();
  client->send_pose(1);
  client->send_ack(client->receive_frame().header.frame_id());
  program.signal(SIGSTOP);
  client.reset();  // as one does that hears nothing any more
  std::jthread later([&] {
    std::this_thread::sleep_for(std::chrono::seconds(1));
    program.signal(SIGCONT);
  });
  WireClient again(program.port());  // answered once the server goes on
  EXPECT_EQ(again.greet(resuming_hello(welcome.resume_token(), 2)).session_id(),
            welcome.session_id());
  EXPECT_TRUE(again.receive_frame().header.idr());
}

}  // namespace
}  // namespace catgs::test
