// Integration: the program in a process of its own, and signals.

#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "render_core/scene/files/save_scene.h"
#include "server/net/visitor_address.h"
#include "tests/render_core/scene/random_cloud.h"
#include "tests/support/server_client.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test.h"

namespace catgs::test {
namespace {

/// catgs-server on a port of the system's choice, serving synth:city. Its end kills it.
class Program {
 public:
  /// Waits until the log says `until`. A later argument wins.
  /// `descriptors`: how many it may have; 0: as many as this process.
  explicit Program(const std::vector<std::string>& more = {}, const std::string& until = "Ctrl-C",
                   rlim_t descriptors = 0) {
    std::vector<std::string> words = {"catgs-server", "--port", "0",          "--admin-bind", "off",
                                      "--drain-wait", "1",      "--renderer", "cpu"};
    words.insert(words.end(), more.begin(), more.end());
    if (std::ranges::count(more, "--scene") + std::ranges::count(more, "--scene-folder") == 0)
      words.insert(words.begin() + 1, {"synth:city:2000", "synth:city:2000"});  // one scene
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    int log_pipe[2];
    if (::pipe(log_pipe) != 0) throw std::runtime_error("no pipe");
    pid_ = ::fork();
    if (pid_ < 0) throw std::runtime_error("no process");
    if (pid_ == 0) {
      for (const int output : {STDOUT_FILENO, STDERR_FILENO}) ::dup2(log_pipe[1], output);
      const rlimit limit{descriptors, descriptors};
      if (descriptors > 0) ::setrlimit(RLIMIT_NOFILE, &limit);
      ::execv(CATGS_SERVER_PROGRAM, arguments.data());
      ::_exit(127);
    }
    ::close(log_pipe[1]);
    log_end_ = log_pipe[0];
    read_log(until);
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

  /// Until the log says this, or the process has ended.
  void read_log(const std::string& until) {
    char buffer[512];
    for (ssize_t n; log_.find(until) == std::string::npos &&
                    (n = ::read(log_end_, buffer, sizeof buffer)) > 0;)
      log_.append(buffer, static_cast<std::size_t>(n));
  }
  /// What was read of it.
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
  /// Its exit status; -1 where a signal ended it.
  int exit_status() {
    const int status = wait();
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
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
  const std::string scenes = http_get(program.port(), "/api/scenes").body;
  EXPECT_EQ(scenes.find("\"id\""), scenes.rfind("\"id\"")) << scenes;
  program.signal(SIGTERM);
  while (http_get(program.port(), "/readyz").status != 503) std::this_thread::sleep_for(10ms);
  EXPECT_EQ(http_get(program.port(), "/healthz").status, 200) << "proxies see it go";
  EXPECT_EQ(program.exit_status(), 0);
}

TEST(ServerProgram, EndsCleanlyOnSigtermWhileItLoads) {
  Program program({"--scene", "synth:city:1000000"}, "loading synth:city:1000000");
  program.signal(SIGTERM);
  program.read_log("stopped while scenes were loading");
  EXPECT_THAT(program.log(), HasSubstr("stopped while scenes were loading"));
  EXPECT_EQ(program.exit_status(), 0);
}

/// What catgs-server ends with, before it serves anybody.
int status_of_refusal(const std::vector<std::string>& arguments, const std::string& reason) {
  Program program(arguments, reason);
  EXPECT_THAT(program.log(), HasSubstr(reason));
  return program.exit_status();
}

TEST(ServerProgram, SupervisorsTellAFaultFromAMistake) {
  constexpr int fault = 1, mistake = 2;
  EXPECT_EQ(status_of_refusal({"--scene", "nowhere.ply"}, "there is no such file"), mistake);
  const TemporaryFolder folder;
  const auto evil = folder.write("evil.ply", "ply\nformat \x1b[31mevil 1.0\n").string();
  EXPECT_EQ(status_of_refusal({"--scene", evil}, "'\\x1b[31mevil'"), mistake);
  EXPECT_EQ(status_of_refusal({"--renderer", "cpu", "--device", "0"}, "--device"), mistake);
  // Without a GPU, as where one is lost; a build without the core stays one.
  ::setenv("CUDA_VISIBLE_DEVICES", "", 1);
  EXPECT_EQ(status_of_refusal({"--renderer", "cuda"}, "--renderer cuda"),
            CATGS_HAS_CUDA ? fault : mistake);
  save_scene(random_cloud(100, 0), folder / "attic.ply");
  EXPECT_EQ(status_of_refusal({"--renderer", "cuda", "--scene-folder", folder.path().string()},
                              "--renderer cuda"),
            CATGS_HAS_CUDA ? fault : mistake);
  ::unsetenv("CUDA_VISIBLE_DEVICES");
}

TEST(ServerProgram, DoesNotStartWithDescriptorsForItsOwnWorkAlone) {
  Program refused({}, "ulimit -n", 64);
  EXPECT_THAT(refused.log(), AllOf(HasSubstr("64 descriptors are allowed, and at least "),
                                   Not(HasSubstr("http://"))));
  EXPECT_EQ(refused.exit_status(), 2);
  Program serves({}, "Ctrl-C", 128);
  EXPECT_EQ(http_get(serves.port(), "/healthz").status, 200);
}

TEST(ServerProgram, WarningsAboutSettingsAreLinesOfTheLog) {
  ::setenv("CATGS_MAX_SESSION", "3", 1);
  Program program({"--print-config", "--log-format", "json"}, "}\n");
  ::unsetenv("CATGS_MAX_SESSION");
  EXPECT_THAT(program.log(), AllOf(StartsWith("{\"time\":"), HasSubstr("CATGS_MAX_SESSION")))
      << "standard output is a file of settings";
  EXPECT_EQ(program.exit_status(), 0);
}

/// The lines of a log in JSON, by event. Throws where one is something else.
std::multimap<std::string, nlohmann::json> by_event(const std::string& log) {
  std::multimap<std::string, nlohmann::json> lines;
  std::istringstream text(log);
  for (std::string line; std::getline(text, line);) {
    auto said = nlohmann::json::parse(line);
    lines.emplace(said.at("event").get<std::string>(), said);
  }
  return lines;
}

TEST(ServerProgram, EveryLineOfAJsonLogSaysWhatHappenedToWhom) {
  Program program({"--log-format", "json", "--log-level", "debug", "--drain-wait", "0"});
  {
    WireClient visitor(program.port());
    const v1::Welcome welcome = visitor.greet();
    visitor.present();
    WireClient spectator(program.port());
    v1::ClientMessage watching = hello_by("");
    watching.mutable_hello()->set_watch(welcome.watch_token());
    spectator.greet(watching);
    refusal(program.port(), hello_by("", "attic"));
    visitor.close(1001);
  }
  raw_answer(program.port(), "POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 0\r\n\r\n");
  program.read_log("\"code\":\"405\"");
  program.read_log("\"event\":\"session_ended\"");
  program.signal(SIGTERM);
  program.read_log("never said");
  EXPECT_EQ(program.exit_status(), 0);

  const auto lines = by_event(program.log());
  const auto line = [&](const char* event) {
    const auto found = lines.find(event);
    return found == lines.end() ? nlohmann::json() : found->second;
  };
  for (const char* event : {"scene_loading", "renderer", "encoder", "ready", "stopped"})
    EXPECT_TRUE(lines.contains(event)) << event;
  EXPECT_EQ(line("scene_loaded").value("scene", ""), "city");
  const std::string session = line("session_admitted").value("session", "");
  EXPECT_EQ(session.size(), 8u);
  for (const char* event : {"session_admitted", "spectator_joined", "session_ended"}) {
    EXPECT_EQ(line(event).value("session", ""), session) << event;
    EXPECT_EQ(line(event).value("scene", ""), "city") << event;
    EXPECT_EQ(line(event).value("address", ""), "127.0.0.1") << event;
  }
  EXPECT_EQ(line("session_refused").value("code", ""), "unknown_scene");
  EXPECT_EQ(line("request_refused").value("code", ""), "405");
  EXPECT_EQ(line("request_refused").value("address", ""), "127.0.0.1");
}

TEST(ServerProgram, TheAddressThatItPrintsOpens) {
  const std::string tokens = static_token_file();
  const auto printed = [](const Program& program) {
    const std::string log = program.log().substr(program.log().find("open http://") + 5);
    return log.substr(0, log.find(' '));
  };
  Program local({"--token-file", tokens}, "Ctrl-C");
  EXPECT_THAT(printed(local), MatchesRegex("http://127.0.0.1:[0-9]+/#token=TOKEN"));
  EXPECT_THAT(local.log(), HasSubstr("visitors need a TOKEN in the address: a line of " + tokens));
  Program open({"--bind", "0.0.0.0", "--open", "--log-format", "json"}, "Ctrl-C");
  const std::string address = printed(open).substr(std::string("http://").size());
  const std::string host = address.substr(0, address.find('/'));
  const int port = std::stoi(host.substr(host.rfind(':') + 1));
  EXPECT_EQ(http_get(port, "/api/scenes", {{"Host", host}}).status, 200) << address;
  if (!machine_addresses().empty()) {
    EXPECT_EQ(host.find("localhost"), std::string::npos) << "other machines have one of their own";
    EXPECT_THAT(open.log(), HasSubstr(fmt::format("also http://localhost:{}/", port)));
  }
}

/// As its usage line has it: options, then scenes.
TEST(ServerProgram, AnOptionTakesItsOwnValueAndNoScene) {
  Program program({"--scene", "synth:city:2000", "synth:city:2001", "--threads", "1",
                   "synth:city:2002", "--fps=30", "synth:city:2003", "--allow-origin",
                   "https://a.example", "synth:city:2004"});
  const auto listed = nlohmann::json::parse(http_get(program.port(), "/api/scenes").body);
  EXPECT_EQ(listed.at("scenes").size(), 5u) << listed;
}

TEST(ServerProgram, AMistakeInACommandNamesItsOwnHelp) {
  Program program({"token"}, "--help)");
  EXPECT_THAT(program.log(), HasSubstr("--token-key-file is required"));
  EXPECT_THAT(program.log(), HasSubstr("see catgs-server token --help"));
  EXPECT_EQ(program.exit_status(), 2);
}

TEST(ServerProgram, ATokenForANameSaysWhatThatMeans) {
  const std::string key = link_key_file();
  Program named({"token", "--token-key-file", key, "--scene", "hall"}, "one file.\n");
  EXPECT_THAT(named.log(), HasSubstr("\"hall\" is a name"));
  EXPECT_EQ(named.exit_status(), 0);
  Program saves({"token", "--token-key-file", key, "--scene", "hall", "--role", "author"}, "tells");
  EXPECT_THAT(saves.log(), AllOf(HasSubstr("--scene hall"), HasSubstr("needs the id")));
  EXPECT_EQ(saves.exit_status(), 2);
  Program exact({"token", "--token-key-file", key, "--scene", "hall-kdfmqrtv"}, "#token=TOKEN\n");
  EXPECT_THAT(exact.log(), AllOf(Not(HasSubstr("is a name")), HasSubstr("its id is ")));
  Program link({"token", "--token-key-file", key, "--scene", "hall-kdfmqrtv", "--role", "author",
                "--expires", "12h", "--address", "https://museum.example/3d"},
               "ends this link\n");
  EXPECT_THAT(
      link.log(),
      AllOf(testing::ContainsRegex("https://museum.example/3d/\\?scene=hall-kdfmqrtv&author#token="
                                   "[A-Za-z0-9_-]+\\.[A-Za-z0-9_-]+\n"),
            testing::ContainsRegex("valid for 12h, until 20[0-9-]+ [0-9:]+ UTC\n")));
  Program unclear({"token", "--token-key-file", key, "--address", "museum.example"}, "example/");
  EXPECT_THAT(unclear.log(), HasSubstr("--address museum.example: is no address of a page"));
  EXPECT_EQ(exact.exit_status(), 0);
}

TEST(ServerProgram, ASecondSigtermEndsTheDrainAtOnce) {
  Program program({"--drain-wait", "600"});
  WireClient client(program.port());
  client.greet();
  program.signal(SIGTERM);
  while (http_get(program.port(), "/readyz").status != 503) std::this_thread::sleep_for(10ms);
  program.signal(SIGTERM);
  EXPECT_EQ(program.exit_status(), 1) << "somebody did not want to wait: visitors were cut off";
}

TEST(ServerProgram, SessionsResumeAfterSigtermOrSigkillAndRestart) {
  // With its key a later process knows the tokens of an earlier one.
  const std::vector<std::string> settings = {"--resume-key-file", link_key_file(),
                                             "--drain-deadline", "1"};
  for (const int number : {SIGTERM, SIGKILL}) {
    auto program = std::make_unique<Program>(settings);
    WireClient client(program->port());
    const v1::Welcome welcome = client.greet();
    client.send_pose(1);
    client.receive_frame();
    program->signal(number);
    if (number == SIGTERM) {
      client.receive_message(v1::ServerMessage::kDrain);
      EXPECT_EQ(client.receive_until_closed().close_code, 1001) << "it stayed until the deadline";
    }
    EXPECT_EQ(program->exit_status(), number == SIGTERM ? 0 : -1);
    program = std::make_unique<Program>(settings);
    WireClient again(program->port());
    EXPECT_EQ(again.greet(resuming_hello(welcome.resume_token(), 7)).session_id(),
              welcome.session_id());
    EXPECT_EQ(again.receive_frame().header.pose_id(), 7u);
  }
}

TEST(ServerProgram, EndsCleanlyAlthoughItWasStoppedWhileItDrains) {
  Program program({"--drain-deadline", "1"});
  WireClient client(program.port());
  client.greet();
  program.signal(SIGTERM);
  program.signal(SIGSTOP);
  std::jthread later([&] {
    std::this_thread::sleep_for(3s);  // longer than the whole drain
    program.signal(SIGCONT);
  });
  client.receive_message(v1::ServerMessage::kDrain);
  EXPECT_EQ(client.receive_until_closed().close_code, 1001);
  later.join();
  EXPECT_EQ(program.exit_status(), 0);
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
    std::this_thread::sleep_for(1s);
    program.signal(SIGCONT);
  });
  WireClient again(program.port());  // answered once the server goes on
  EXPECT_EQ(again.greet(resuming_hello(welcome.resume_token(), 2)).session_id(),
            welcome.session_id());
  EXPECT_TRUE(again.receive_frame().header.idr());
}

TEST(ServerProgram, OneOfTwoOverAFolderSavesAndTheOtherSaysSo) {
  const TemporaryFolder folder;
  save_scene(random_cloud(100, 0), folder / "hall.ply");
  const std::vector<std::string> settings = {"--scene", (folder / "hall.ply").string(),
                                             "--token-key-file", link_key_file()};
  const Program one(settings), other(settings);
  const std::string author = "Bearer " + make_link("author");
  std::string tag;
  for (int round = 0; round < 25; ++round) {
    const auto save = [&](const Program& program, const std::string& title) {
      return http_put(program.port(), "/api/scenes/hall/sidecar", title,
                      {{"authorization", author},
                       {tag.empty() ? "if-none-match" : "if-match", tag.empty() ? "*" : tag}});
    };
    const std::string longer = fmt::format(R"({{"title": "{}{}"}})", std::string(500, 'a'), round);
    const std::string shorter = fmt::format(R"({{"title": "b{}"}})", round);
    auto second = std::async(std::launch::async, [&] { return save(other, shorter); });
    const HttpReply a = save(one, longer), b = second.get();
    ASSERT_EQ(std::min(a.status, b.status), 200) << a.body << b.body;
    ASSERT_EQ(std::max(a.status, b.status), 412) << a.body << b.body;
    std::ifstream written(folder / "hall.json");
    ASSERT_EQ(std::string(std::istreambuf_iterator<char>(written), {}),
              a.status == 200 ? longer : shorter);
    tag = (a.status == 200 ? a : b).headers.at("etag");
  }
}

}  // namespace
}  // namespace catgs::test
