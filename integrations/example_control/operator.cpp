#include "operator.hpp"

#include <poll.h>
#include <unistd.h>

#include <array>
#include <cctype>
#include <map>
#include <sstream>
#include <utility>

namespace {

// jog x+ 20
bool read_jog(std::istream& words, Command& command) {
  std::string way;
  if (!(words >> way >> command.value) || way.size() != 2 || (way[1] != '+' && way[1] != '-')) return false;
  command.axis = std::tolower(static_cast<unsigned char>(way[0])) - 'x';
  if (way[1] == '-') command.value = -command.value;
  return command.axis >= 0 && command.axis < 3;
}

}  // namespace

std::optional<Command> read_command(const std::string& line) {
  static const std::map<std::string, Key> keys = {
      {"hold", Key::hold},     {"!", Key::hold},    {"resume", Key::resume}, {"~", Key::resume},
      {"status", Key::status}, {"?", Key::status},  {"probe", Key::probe},   {"flush", Key::flush},
      {"abort", Key::abort},   {"quit", Key::quit}, {"mdi", Key::mdi},       {"override", Key::feed_override},
      {"jog", Key::jog},       {"wait", Key::wait}};
  std::istringstream words(line.substr(0, line.find('#')));
  std::string word;
  if (!(words >> word)) return std::nullopt;
  Command command;
  command.line = line;
  if (word == "at" && !(words >> command.time_s >> word)) return command;
  const auto found = keys.find(word);
  if (found == keys.end()) return command;
  bool is_good = true;
  if (found->second == Key::feed_override) is_good = static_cast<bool>(words >> command.value);
  if (found->second == Key::mdi) is_good = static_cast<bool>(std::getline(words >> std::ws, command.block));
  if (found->second == Key::jog) is_good = read_jog(words, command);
  if (is_good) command.key = found->second;
  return command;
}

void Terminal::look() {
  for (pollfd input{STDIN_FILENO, POLLIN, 0}; !is_closed_ && poll(&input, 1, 0) > 0;) read();
}

void Terminal::read_to_the_end() {
  while (!is_closed_) read();
}

void Terminal::read() {
  std::array<char, 1024> part{};
  const auto count = ::read(STDIN_FILENO, part.data(), part.size());
  is_closed_ = count <= 0;
  text_.append(part.data(), count > 0 ? static_cast<std::size_t>(count) : 0);
  if (is_closed_ && !text_.empty()) text_ += '\n';
  for (auto end = text_.find('\n'); end != std::string::npos; end = text_.find('\n')) {
    if (auto command = read_command(text_.substr(0, end))) commands_.push_back(std::move(*command));
    text_.erase(0, end + 1);
  }
}

std::optional<Command> Terminal::take(double time_s, bool is_at_rest) {
  if (commands_.empty() || commands_.front().time_s > time_s) return std::nullopt;
  if (commands_.front().key == Key::wait && !is_at_rest) return std::nullopt;
  Command command = std::move(commands_.front());
  commands_.pop_front();
  return command;
}
